"""`skyway schedule`: calendars of drones and reservations of pads, drawn as text."""

import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from skyway.cli.schedule import Bar, Row, gantt_lines
from tests.library.cli.conftest import Gateway

runner = CliRunner()

DRONE: dict[str, Any] = {
    "drone_id": "drn_1",
    "provider_id": "prv_1",
    "at": "2026-03-01T12:00:00Z",
    "free_from": {"at": "2026-03-01T15:00:00Z", "station_id": "kyle", "soc": 0.5},
    "entries": [
        {
            "state": "ACTIVE",
            "service": {"start_at": "2026-03-01T12:00:00Z", "served_at": "2026-03-01T13:00:00Z"},
            "standby": {"until_at": "2026-03-01T14:00:00Z"},
        },
        {
            "state": "QUEUED",
            "service": {"start_at": "2026-03-01T14:00:00Z", "served_at": "2026-03-01T15:00:00Z"},
            "standby": {"until_at": "2026-03-01T16:00:00Z"},
        },
    ],
}


@pytest.fixture
def gateway(answering_gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> Gateway:
    """A gateway with a provider, a drone with two missions, and a station with a reservation."""
    monkeypatch.setenv("COLUMNS", "80")
    reservation = {
        "pad": 1,
        "start_at": "2026-03-01T12:00:00Z",
        "end_at": "2026-03-01T13:00:00Z",
    }
    providers = [{"provider_id": "prv_1", "name": "Hill Country Drones"}]
    named = {"drone_id": "drn_1", "name": "Falcon"}
    answering_gateway.answers |= {
        ("GET", "/v1/drones/drn_1/schedule"): (200, DRONE),
        ("GET", "/v1/providers"): (200, {"items": providers, "next_cursor": None}),
        ("GET", "/v1/providers/prv_1/schedule"): (200, {"items": [DRONE], "next_cursor": None}),
        ("GET", "/v1/providers/prv_1/drones"): (200, {"items": [named], "next_cursor": None}),
        ("GET", "/v1/stations/kyle/reservations"): (
            200,
            {"items": [reservation], "next_cursor": None},
        ),
    }
    return answering_gateway


def output(*arguments: str) -> str:
    result = runner.invoke(make_app(), ["schedule", *arguments])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.usefixtures("gateway")
@pytest.mark.parametrize(
    ("options", "label"),
    [
        ((), "drn_1 (Falcon)"),
        (("--drone", "drn_1"), "drn_1"),
        (("--provider", "prv_1"), "drn_1 (Falcon)"),
        (("--provider", "Hill Country Drones"), "drn_1 (Falcon)"),
    ],
)
def test_a_drones_line_shows_service_standby_and_when_it_is_free(
    options: tuple[str, ...], label: str
):
    *_, line = output(*options).splitlines()

    assert line == f"{label} {'#' * 10}{'.' * 10}{'=' * 10}{'.' * 10} free 03-01 15:00 kyle 50%"


@pytest.mark.usefixtures("gateway")
def test_a_pads_line_shows_its_reservations():
    *_, line = output("--station", "kyle").splitlines()

    assert line == "pad 1 " + "#" * 40


@pytest.mark.usefixtures("gateway")
def test_json_is_the_answer_of_the_gateway():
    assert json.loads(output("--drone", "drn_1", "--json")) == DRONE
    assert json.loads(output("--provider", "prv_1", "--json")) == {"items": [DRONE]}


def test_a_drone_without_missions_is_free_and_nothing_is_planned(gateway: Gateway):
    idle = {**DRONE, "entries": [], "free_from": None}
    gateway.answers["GET", "/v1/drones/drn_1/schedule"] = (200, idle)

    assert output("--drone", "drn_1").splitlines() == ["drn_1 free", "nothing is planned"]


def test_two_choices_are_refused_and_nothing_is_asked(gateway: Gateway):
    result = runner.invoke(make_app(), ["schedule", "--drone", "a", "--station", "b"])

    assert result.exit_code == 1
    assert "only one of" in result.output
    assert gateway.calls == []


NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def hours(number: float) -> datetime:
    return NOON + timedelta(hours=number)


def drawn(*rows: Row, columns: int = 60) -> list[str]:
    return gantt_lines(rows, start_at=NOON, end_at=hours(6), columns=columns)


def test_bars_stand_below_their_moments():
    axis, line = drawn(Row("drn_1", (Bar(hours(2), hours(4), "#"),)))

    assert axis == "      03-01 12:00         03-01 14:00         03-01 16:00"
    assert line == "drn_1 " + " " * 20 + "#" * 20


def test_a_later_bar_covers_an_earlier_one():
    _, line = drawn(Row("d", (Bar(NOON, hours(6), "."), Bar(hours(3), hours(6), "#"))))

    assert line == "d " + "." * 30 + "#" * 30


def test_a_short_bar_has_one_character():
    _, line = drawn(Row("d", (Bar(hours(6), hours(6), "#"),)))

    assert line == "d " + " " * 59 + "#"


def test_bars_outside_the_axis_are_left_out_and_others_are_cut():
    outside = Bar(hours(-3), hours(-2), "#")
    _, line = drawn(Row("d", (outside, Bar(hours(-1), hours(1), "="))))

    assert line == "d " + "=" * 10


def test_labels_are_aligned_and_notes_follow_the_bars():
    _, first, second = drawn(Row("a", ()), Row("long", (), "free"), columns=5)

    assert first == "a"
    assert second == "long" + " " * 7 + "free"
