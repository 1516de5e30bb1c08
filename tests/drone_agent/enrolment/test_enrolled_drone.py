"""The fleet file is the registry's answer, in each of its three forms."""

import json
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.enrolment.enrolled_drone import read_fleet

from skyway.errors import InvalidInput


@pytest.fixture
def answer(drone: Any) -> dict[str, Any]:
    made: dict[str, Any] = json.loads(drone.model_dump_json())
    return made | {"state": "REGISTERED", "name": "a field the agent has no use for"}


def write(tmp_path: Path, content: object) -> Path:
    path = tmp_path / "fleet.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("form", ["one", "list", "items"])
def test_one_drone_a_list_and_a_page_are_read(
    tmp_path: Path, answer: dict[str, Any], form: str
) -> None:
    content: dict[str, object] = {"one": answer, "list": [answer], "items": {"items": [answer]}}

    (read,) = read_fleet(write(tmp_path, content[form]))

    assert read.drone_id == "drn_1"
    assert read.at_first().station_id == "home"


def test_a_file_without_passwords_is_refused_by_name(
    tmp_path: Path, answer: dict[str, Any]
) -> None:
    del answer["mqtt"]

    with pytest.raises(InvalidInput, match="mqtt"):
        read_fleet(write(tmp_path, answer))


def test_a_file_that_is_not_json_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fleet.json"
    path.write_text("{")

    with pytest.raises(InvalidInput, match="not JSON"):
        read_fleet(path)


def test_a_password_is_not_shown(tmp_path: Path, answer: dict[str, Any]) -> None:
    (read,) = read_fleet(write(tmp_path, answer))

    assert read.mqtt.password not in repr(read)
