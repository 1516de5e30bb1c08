"""`skyway quarantine`: lists, replays and deletes the messages that were not taken."""

from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

runner = CliRunner()

MESSAGE: dict[str, Any] = {
    "quarantine_id": "qua_1",
    "reason": "UNREADABLE",
    "detail": "seq: must be a whole number",
    "topic": "skyway/v1/prv_1/drn_1/acks",
    "last_received_at": "2026-03-01T12:00:00Z",
    "times": 3,
}


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    answering_gateway.answers |= {
        ("GET", "/v1/quarantine"): (200, {"items": [MESSAGE], "next_cursor": None}),
        ("POST", "/v1/quarantine/qua_1/replay"): (204, None),
        ("DELETE", "/v1/quarantine/qua_1"): (204, None),
    }
    return answering_gateway


def run(*arguments: str) -> Any:
    return runner.invoke(make_app(), ["quarantine", *arguments])


def test_each_message_has_a_line_with_its_reason(gateway: Gateway) -> None:
    result = run()

    assert result.exit_code == 0
    assert result.stdout == (
        "qua_1  2026-03-01T12:00:00Z  3 x  UNREADABLE  skyway/v1/prv_1/drn_1/acks  "
        "seq: must be a whole number\n"
    )


def test_an_empty_quarantine_says_so(gateway: Gateway) -> None:
    gateway.answers["GET", "/v1/quarantine"] = (200, {"items": [], "next_cursor": None})

    assert run().stdout == "the quarantine is empty\n"


@pytest.mark.parametrize(
    ("option", "call"),
    [
        ("--replay", ("POST", "/v1/quarantine/qua_1/replay")),
        ("--delete", ("DELETE", "/v1/quarantine/qua_1")),
    ],
)
def test_a_message_is_replayed_or_deleted(
    gateway: Gateway, option: str, call: tuple[str, str]
) -> None:
    result = run(option, "qua_1")

    assert result.exit_code == 0
    assert gateway.called == [call]


def test_only_one_thing_is_done_at_a_time(gateway: Gateway) -> None:
    assert run("--replay", "qua_1", "--delete", "qua_1").exit_code == 1
