"""`skyway alarms`: lists and acknowledges alarms."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

ALARM: dict[str, Any] = {
    "alarm_id": "alm_1",
    "level": "URGENT",
    "code": "BATTERY_LOW",
    "detail": "The battery holds less than the plan needs.",
    "at": "2026-03-01T12:00:00Z",
    "drone_id": "drn_1",
    "mission_id": "mis_1",
    "station_id": None,
    "acknowledged_by": None,
}
LINE = (
    "alm_1  2026-03-01T12:00:00Z  URGENT  BATTERY_LOW  drn_1  "
    "The battery holds less than the plan needs."
)


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    acknowledged = {**ALARM, "acknowledged_by": "operator:ops"}
    answering_gateway.answers |= {
        ("GET", "/v1/alarms"): (200, {"items": [ALARM], "next_cursor": None}),
        ("POST", "/v1/alarms/alm_1/acknowledgements"): (200, acknowledged),
    }
    return answering_gateway


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["alarms", *arguments])


def test_each_open_alarm_has_a_line(gateway: Gateway) -> None:
    assert run().stdout == f"{LINE}\n"
    assert gateway.queries == ["limit=200&state=OPEN"]


def test_alarms_of_one_level_and_acknowledged_ones_can_be_listed(gateway: Gateway) -> None:
    run("--all", "--level", "CRITICAL")

    assert gateway.queries == ["limit=200&level=CRITICAL"]


def test_an_alarm_is_acknowledged_with_a_note(gateway: Gateway) -> None:
    result = run("--acknowledge", "alm_1", "--note", "called the provider")

    assert result.stdout == f"{LINE}  (acknowledged by operator:ops)\n"
    assert gateway.calls[-1][2] == {"note": "called the provider"}


def test_a_note_needs_an_alarm(gateway: Gateway) -> None:
    result = run("--note", "nothing")

    assert (result.exit_code, result.stderr) == (1, "--note goes with --acknowledge\n")
    assert gateway.calls == []


def test_programs_get_json(gateway: Gateway) -> None:
    assert json.loads(run("--json").stdout) == [ALARM]


def test_no_alarms_say_so(gateway: Gateway) -> None:
    gateway.answers["GET", "/v1/alarms"] = (200, {"items": [], "next_cursor": None})

    assert run().stdout == "no open alarms\n"
    assert run("--all").stdout == "no alarms\n"
