"""`skyway mission`: an operator's commands to a mission."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

PATH = "/v1/missions/mis_1/commands"
ANSWER: dict[str, Any] = {
    "mission_id": "mis_1",
    "command": "HOLD",
    "instruction_id": "ins_1",
    "waits_for": None,
}


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    answering_gateway.answers["POST", PATH] = (202, ANSWER)
    return answering_gateway


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["mission", *arguments])


@pytest.mark.parametrize(
    ("arguments", "body"),
    [
        (("hold", "mis_1"), {"command": "HOLD"}),
        (("resume", "mis_1"), {"command": "RESUME"}),
        (
            ("divert", "mis_1", "kyle"),
            {"command": "DIVERT", "station_id": "kyle", "overrides_failsafe": False},
        ),
        (
            ("return-home", "mis_1", "--override-failsafe"),
            {"command": "RETURN_HOME", "overrides_failsafe": True},
        ),
        (("cancel", "mis_1"), {"command": "CANCEL"}),
        (("give-up", "mis_1"), {"command": "GIVE_UP"}),
    ],
)
def test_each_command_is_sent_with_its_reason(
    gateway: Gateway, arguments: tuple[str, ...], body: dict[str, Any]
) -> None:
    result = run(*arguments, "--reason", "crowd")

    assert result.exit_code == 0, result.output
    assert gateway.calls == [("POST", PATH, body | {"reason": "crowd"})]


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        ({}, "mis_1: HOLD is accepted; the drone gets instruction ins_1"),
        (
            {"instruction_id": None},
            "mis_1: HOLD is accepted; the drone gets it with its next plan",
        ),
        (
            {"waits_for": {"fault": "WIND", "failsafe": "STAY"}},
            "mis_1: HOLD is accepted; it waits until the failsafe STAY (WIND) ends",
        ),
    ],
)
def test_the_answer_says_when_the_drone_gets_it(
    gateway: Gateway, answer: dict[str, Any], line: str
) -> None:
    gateway.answers["POST", PATH] = (202, ANSWER | answer)

    assert run("hold", "mis_1", "--reason", "crowd").stdout == f"{line}\n"


def test_a_dry_run_shows_what_the_command_would_do(gateway: Gateway) -> None:
    outlook = {"plan": "NOT_NEEDED", "code": None, "detail": None, "ends_mission": False}
    preview = {
        "mission_id": "mis_1",
        "command": "HOLD",
        "outlook": {**outlook, "next_landing": None, "packages": []},
    }
    gateway.answers["POST", PATH] = (200, preview)

    result = run("hold", "mis_1", "--reason", "crowd", "--dry-run")

    assert gateway.queries == ["dry_run=true"]
    assert result.stdout == "mis_1: HOLD needs no new plan\n"


def test_programs_get_json(gateway: Gateway) -> None:
    assert json.loads(run("hold", "mis_1", "--reason", "crowd", "--json").stdout) == ANSWER


def test_a_command_without_a_reason_is_refused(gateway: Gateway) -> None:
    assert run("hold", "mis_1").exit_code == 2
    assert gateway.calls == []


def test_a_refusal_says_why(gateway: Gateway) -> None:
    gateway.answers["POST", PATH] = (409, {"detail": "the mission is held already"})

    result = run("hold", "mis_1", "--reason", "crowd")

    assert result.exit_code == 1
    assert "the mission is held already" in result.stderr
