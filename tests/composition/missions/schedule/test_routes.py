"""Schedules over REST: a drone's missions in time order, and when it is free."""

from datetime import datetime, timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


@pytest.fixture
async def chained(composition: Any, drone: Any, make: Any) -> Any:
    """A drone that has accepted a mission to c, and a QUEUED mission behind it."""
    await composition.receive(drone.state())
    await composition.book(make.candidate(1))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    behind = await composition.book(make.candidate(1), delivery_id="dlv_2")
    assert [each.state for each in behind.missions] == ["QUEUED"], behind
    return composition


async def shown(composition: Any, path: str, caller: str = OPERATOR) -> Any:
    answer = await composition(caller, "GET", path)
    assert answer.status_code == 200, answer.text
    return answer.json()


def moment(text: str) -> datetime:
    return datetime.fromisoformat(text)


async def test_a_drones_schedule_lists_its_missions_in_time_order(chained: Any) -> None:
    schedule = await shown(chained, "/v1/drones/drn_1/schedule")

    first, second = schedule["entries"]
    assert [each["delivery_id"] for each in (first, second)] == ["dlv_1", "dlv_2"]
    assert [each["state"] for each in (first, second)] == ["ACCEPTED", "QUEUED"]
    assert first["service"]["to_station_id"] == "c"
    assert first["service"]["start_at"] < first["service"]["served_at"]
    assert first["service"]["served_at"] < second["service"]["start_at"]


async def test_a_mission_begins_where_the_drone_is_free_after_the_one_before(chained: Any) -> None:
    schedule = await shown(chained, "/v1/drones/drn_1/schedule")

    first, second = schedule["entries"]
    assert first["free_from"]["at"] == first["service"]["served_at"]
    assert first["free_from"]["station_id"] == "c"
    assert second["service"]["from_station_id"] == "c"
    assert schedule["free_from"] == second["free_from"]


async def test_a_drone_without_missions_has_an_empty_schedule(composition: Any, drone: Any) -> None:
    await composition.receive(drone.state())

    schedule = await shown(composition, "/v1/drones/drn_1/schedule")

    assert (schedule["entries"], schedule["free_from"]) == ([], None)


@pytest.mark.parametrize(
    ("caller", "path", "status"),
    [
        ("provider:prv_1", "/v1/drones/drn_1/schedule", 200),
        ("provider:prv_2", "/v1/drones/drn_1/schedule", 404),
        (OPERATOR, "/v1/drones/drn_9/schedule", 404),
        ("customer:c", "/v1/drones/drn_1/schedule", 403),
        ("provider:prv_1", "/v1/providers/prv_1/schedule", 200),
        ("provider:prv_2", "/v1/providers/prv_1/schedule", 404),
        ("customer:c", "/v1/providers/prv_1/schedule", 403),
    ],
)
async def test_only_operators_and_the_drones_provider_see_a_schedule(
    chained: Any, caller: str, path: str, status: int
) -> None:
    answer = await chained(caller, "GET", path)

    assert answer.status_code == status


async def test_a_providers_schedule_comes_in_pages_of_drones(chained: Any, make: Any) -> None:
    await chained.book(make.candidate(2), delivery_id="dlv_3")

    first = await shown(chained, "/v1/providers/prv_1/schedule?limit=1", "provider:prv_1")
    second = await shown(
        chained, f"/v1/providers/prv_1/schedule?limit=1&cursor={first['next_cursor']}"
    )

    drones = [(each["drone_id"], len(each["entries"])) for each in first["items"] + second["items"]]
    assert drones == [("drn_1", 2), ("drn_2", 1)]
    assert second["next_cursor"] is None


async def test_a_providers_schedule_shows_the_missions_of_the_span_only(chained: Any) -> None:
    (drone,) = (await shown(chained, "/v1/providers/prv_1/schedule"))["items"]
    begins_at = drone["entries"][1]["service"]["start_at"]
    begin = moment(begins_at)

    before = await shown(chained, f"/v1/providers/prv_1/schedule?to={begins_at}")
    after = await shown(
        chained,
        f"/v1/providers/prv_1/schedule?from={(begin + timedelta(days=3)):%Y-%m-%dT%H:%M:%SZ}",
    )

    assert [each["delivery_id"] for each in before["items"][0]["entries"]] == ["dlv_1"]
    assert after["items"] == []


async def test_a_mission_that_is_over_ends_when_its_last_step_ended(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    flown = drone.flown(instruction)
    composition.clock.advance(instruction.steps[-1].planned_end_at - composition.clock.now())
    await composition.receive(drone.ack(instruction), *flown, drone.state())
    composition.clock.advance(timedelta(hours=1))

    now = await shown(composition, "/v1/providers/prv_1/schedule")
    since = "2026-03-01T00:00:00Z"
    past = await shown(composition, f"/v1/providers/prv_1/schedule?from={since}")

    assert now["items"] == []
    (entry,) = past["items"][0]["entries"]
    assert (entry["state"], entry["free_from"]) == ("COMPLETED", None)
    ended_at = max(event.message.ended_at for event in flown if event.message.ended_at is not None)
    assert ended_at - moment(entry["standby"]["until_at"]) < timedelta(milliseconds=1)


@pytest.mark.parametrize(("caller", "shows"), [(OPERATOR, True), ("customer:c", False)])
async def test_a_stations_schedule_lists_the_reservations_of_each_pad(
    chained: Any, caller: str, shows: bool
) -> None:
    reserved = (await shown(chained, "/v1/stations/c/reservations"))["items"]
    assert reserved

    found = await shown(chained, "/v1/stations/c/schedule", caller)

    listed = [
        {"station_id": "c", "pad": pad["pad"], **entry}
        for pad in found["pads"]
        for entry in pad["entries"]
    ]
    expected = [each if shows else {**each, "mission_id": None} for each in reserved]
    assert sorted(listed, key=str) == sorted(expected, key=str)


async def test_a_stations_schedule_shows_the_reservations_of_the_span_only(chained: Any) -> None:
    (first, *_) = (await shown(chained, "/v1/stations/c/reservations"))["items"]

    span = f"from=2026-03-01T00:00:00Z&to={first['start_at']}"
    before = await shown(chained, f"/v1/stations/c/schedule?{span}")

    assert [pad["entries"] for pad in before["pads"]] == [[]] * len(before["pads"])
    assert before["to_at"] == first["start_at"]


async def test_an_unknown_station_has_no_schedule(chained: Any) -> None:
    answer = await chained(OPERATOR, "GET", "/v1/stations/nowhere/schedule")

    assert answer.status_code == 404


@pytest.mark.parametrize(
    ("query", "field", "words"),
    [
        ("from=2026-03-02T00:00:00Z&to=2026-03-01T00:00:00Z", "from", "must be before `to`"),
        ("from=2026-03-01T00:00:00Z&to=2026-05-01T00:00:00Z", "to", "the limit is 31 days"),
        ("from=9999-12-30T00:00:00Z", "from", "must be between"),
        ("from=yesterday", "from", "must be a moment like"),
    ],
)
async def test_a_span_that_cannot_be_shown_is_refused_with_its_limit(
    composition: Any, query: str, field: str, words: str
) -> None:
    answer = await composition(OPERATOR, "GET", f"/v1/providers/prv_1/schedule?{query}")

    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"].split(".")[-1] == field
    assert words in error["detail"]


async def test_a_span_that_begins_at_the_end_of_the_calendar_ends_there(composition: Any) -> None:
    answer = await composition(
        OPERATOR, "GET", "/v1/providers/prv_1/schedule?from=8999-12-30T00:00:00Z"
    )

    assert answer.status_code == 200, answer.text
