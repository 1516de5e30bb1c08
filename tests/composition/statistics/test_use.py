"""GET /v1/stats/pads and /v1/stats/drones: numbers computed by hand, on both databases."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Any

import pytest
from skyway_lab.experiments.fleet_hour.utilisation import StepTime, spent_ms
from sqlalchemy import text

from skyway.units import moment_to_ms

OPERATOR = "operator:op"

#: kind, station, pad, from minute, to minute.
Step = tuple[str, str | None, int | None, float, float]


async def insert(composition: Any, table: str, **values: object) -> None:
    names = ", ".join(values)
    places = ", ".join(f":{name}" for name in values)
    async with composition.db.write() as tx:
        statement = text(f"INSERT INTO {table} ({names}) VALUES ({places})")
        await tx.execute(statement, values)


async def add_mission(
    composition: Any,
    mission_id: str,
    steps: Sequence[Step],
    *,
    drone_id: str = "drn_1",
    provider_id: str = "prv_1",
) -> None:
    """A mission that is over; minutes count from the start of the test."""
    start_ms = moment_to_ms(composition.clock.now())
    await insert(composition, "deliveries", delivery_id=f"dlv_{mission_id}")
    await insert(
        composition,
        "missions",
        mission_id=mission_id,
        delivery_id=f"dlv_{mission_id}",
        attempt=1,
        trip=1,
        provider_id=provider_id,
        drone_id=drone_id,
        state="COMPLETED",
        network_id="row",
        start_ms=start_ms,
        served_ms=start_ms,
        released_ms=start_ms,
        expires_ms=start_ms,
        body="{}",
        request="{}",
        candidate="{}",
        report_seq=0,
    )
    for number, (kind, station_id, pad, start, end) in enumerate(steps, 1):
        await insert(
            composition,
            "mission_steps",
            mission_id=mission_id,
            step_id=number,
            revision=1,
            status="ENDED",
            step="{}",
            kind=kind,
            station_id=station_id,
            pad=pad,
            planned_start_ms=start_ms + round(start * 60_000),
            planned_end_ms=start_ms + round(end * 60_000),
            started_ms=start_ms + round(start * 60_000),
            ended_ms=start_ms + round(end * 60_000),
        )


@pytest.fixture
async def flown(composition: Any) -> Any:
    """Two missions of drn_1 and one of prv_2's drn_2; an hour has passed.

    drn_1: loads 0 to 2, flies 2 to 10, waits at b 10 to 15, charges there 15 to 35, flies 36 to 40
    (a minute went between), hands over 40 to 41; then 50 to 55 a flight. drn_2: flies 0 to 5,
    charges at b 5 to 15, returns its packages 15 to 20, charges at c 20 to 80.
    """
    await add_mission(
        composition,
        "msn_1",
        [
            ("PICK_UP", "a", None, 0, 2),
            ("FLY", None, None, 2, 10),
            ("WAIT", "b", None, 10, 15),
            ("RECHARGE", "b", 0, 15, 35),
            ("FLY", None, None, 36, 40),
            ("DELIVER", "c", None, 40, 41),
        ],
    )
    await add_mission(composition, "msn_2", [("FLY", None, None, 50, 55)])
    await add_mission(
        composition,
        "msn_3",
        [
            ("FLY", None, None, 0, 5),
            ("RECHARGE", "b", 1, 5, 15),
            ("RETURN", "b", None, 15, 20),
            ("RECHARGE", "c", 0, 20, 80),
        ],
        drone_id="drn_2",
        provider_id="prv_2",
    )
    composition.began_at = composition.clock.now()
    composition.clock.advance(timedelta(hours=2))
    return composition


async def ask(flown: Any, what: str, query: str = "", *, to: int = 60, by: str = OPERATOR) -> Any:
    """The statistics of the first `to` minutes."""
    start = flown.began_at.isoformat().replace("+00:00", "Z")
    end = (flown.began_at + timedelta(minutes=to)).isoformat().replace("+00:00", "Z")
    answer = await flown(by, "GET", f"/v1/stats/{what}?from={start}&to={end}{query}")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_pad_use_is_counted(flown: Any) -> None:
    found = await ask(flown, "pads")

    stations = {one["station_id"]: one for one in found["items"]}
    assert list(stations) == ["a", "b", "c", "d", "e"]
    assert stations["b"] == {
        "station_id": "b",
        "network_id": "row",
        "pads": 2,
        "sessions": 2,
        "charging_s": 30 * 60.0,
        "waiting_s": 5 * 60.0,
        "utilisation": 30 / 120,
    }
    # The session goes on beyond the hour.
    assert (stations["c"]["sessions"], stations["c"]["charging_s"]) == (1, 40 * 60.0)
    assert (stations["a"]["sessions"], stations["a"]["utilisation"]) == (0, 0.0)
    assert found["total"] == {
        "pads": 10,
        "sessions": 3,
        "charging_s": 70 * 60.0,
        "waiting_s": 5 * 60.0,
        "utilisation": 70 / 600,
    }


async def test_drone_use_is_counted(flown: Any) -> None:
    found = await ask(flown, "drones")

    first, second = found["items"]
    assert first == {
        "drone_id": "drn_1",
        "provider_id": "prv_1",
        "missions": 2,
        "busy_s": (41 + 5) * 60.0,
        "flying_s": (8 + 4 + 5) * 60.0,
        "recharging_s": 20 * 60.0,
        "loading_s": 2 * 60.0,
        "delivering_s": 60.0,
        "waiting_s": (5 + 1) * 60.0,
        "approach_s": 5 * 60.0,
        "service_s": (2 + 8 + 5 + 1 + 4 + 1) * 60.0,
        "standby_s": 0.0,
        "idle_s": 14 * 60.0,
        "utilisation": 46 / 60,
    }
    assert second["drone_id"] == "drn_2"
    assert (second["busy_s"], second["recharging_s"]) == (60 * 60.0, 50 * 60.0)
    assert (second["delivering_s"], second["waiting_s"]) == (5 * 60.0, 0.0)
    assert (found["total"]["drones"], found["total"]["missions"]) == (2, 3)
    assert found["total"]["busy_s"] == 106 * 60.0
    assert found["total"]["utilisation"] == pytest.approx(106 / 120)


#: To the pickup with a recharge on the way, a delivery with a recharge, the way home, a recharge.
WHOLE_MISSION: Sequence[Step] = (
    ("FLY", None, None, 0, 4),
    ("RECHARGE", "b", 0, 4, 8),
    ("FLY", None, None, 8, 10),
    ("PICK_UP", "a", None, 10, 12),
    ("FLY", None, None, 12, 16),
    ("RECHARGE", "b", 0, 16, 20),
    ("DELIVER", "c", None, 20, 21),
    ("FLY", None, None, 21, 30),
    ("WAIT", "d", None, 30, 31),
    ("RECHARGE", "d", 0, 31, 50),
)


@pytest.mark.parametrize(("start", "to"), [(0, 60), (0, 11), (13, 25), (22, 40)])
async def test_the_time_of_drones_is_divided_as_in_the_simulation(
    composition: Any, start: int, to: int
) -> None:
    await add_mission(composition, "msn_1", WHOLE_MISSION)
    composition.began_at = composition.clock.now() + timedelta(minutes=start)
    composition.clock.advance(timedelta(hours=2))

    [used] = (await ask(composition, "drones", to=to - start))["items"]

    steps = [StepTime(step[0], int(60 * step[3]), int(60 * step[4])) for step in WHOLE_MISSION]
    spent = spent_ms(steps, served_ms=60 * 21, from_ms=60 * start, until_ms=60 * to)
    assert used["recharging_s"] == spent["charging"]
    assert {each: used[f"{each}_s"] for each in ("approach", "service", "standby")} == {
        each: spent[each] for each in ("approach", "service", "standby")
    }
    assert used["idle_s"] == 60 * (to - start) - sum(spent.values())


async def test_a_mission_with_a_hand_over_left_is_in_service(composition: Any) -> None:
    await add_mission(composition, "msn_1", WHOLE_MISSION)
    async with composition.db.write() as tx:
        values = {"changed": 7}
        not_ended = "UPDATE mission_steps SET ended_ms = NULL WHERE step_id = :changed"
        await tx.execute(text(not_ended), values)
    composition.began_at = composition.clock.now()
    composition.clock.advance(timedelta(hours=2))

    [used] = (await ask(composition, "drones"))["items"]

    assert used["standby_s"] == 0.0


async def test_only_the_part_of_a_step_within_the_span_counts(flown: Any) -> None:
    pads = {one["station_id"]: one for one in (await ask(flown, "pads", to=20))["items"]}
    assert (pads["b"]["sessions"], pads["b"]["charging_s"]) == (2, (5 + 10) * 60.0)
    # Steps that only touch the span do not count.
    assert pads["c"]["sessions"] == 0
    drones = await ask(flown, "drones", to=20)
    assert [one["busy_s"] for one in drones["items"]] == [1200.0, 1200.0]
    assert drones["items"][0]["missions"] == 1
    assert drones["total"]["utilisation"] == 1.0


async def test_future_time_does_not_count_as_idle(flown: Any) -> None:
    found = await ask(flown, "drones", to=600)
    # Two hours have passed.
    assert found["items"][1]["utilisation"] == pytest.approx(80 / 120)


@pytest.mark.parametrize(
    ("by", "query"), [(OPERATOR, "&provider_id=prv_2"), ("provider:prv_2", "")]
)
async def test_a_provider_sees_only_its_own_use(flown: Any, by: str, query: str) -> None:
    pads, drones = [await ask(flown, what, query, by=by) for what in ("pads", "drones")]

    assert (pads["provider_id"], drones["provider_id"]) == ("prv_2", "prv_2")
    assert [one["drone_id"] for one in drones["items"]] == ["drn_2"]
    assert drones["total"]["drones"] == 1
    assert pads["total"]["charging_s"] == 50 * 60.0
    assert [one["charging_s"] for one in pads["items"]] == [0, 600.0, 2400.0, 0, 0]


@pytest.mark.parametrize("what", ["pads", "drones"])
async def test_customers_and_drones_may_not_see_use(flown: Any, what: str) -> None:
    for caller, query, status in (
        ("customer:alice", "", 403),
        ("provider:prv_1", "?provider_id=prv_2", 404),
        ("provider:prv_1", "?provider_id=prv_1", 200),
        (OPERATOR, "?from=2999-01-01T00:00:00Z", 422),
        (OPERATOR, "?bucket=hour", 422),
    ):
        assert (await flown(caller, "GET", f"/v1/stats/{what}{query}")).status_code == status


async def test_use_is_listed_in_pages_and_by_network(flown: Any) -> None:
    first = await ask(flown, "pads", "&limit=3&network_id=row")
    cursor = first["next_cursor"]
    rest = await ask(flown, "pads", f"&limit=3&network_id=row&cursor={cursor}")
    assert [one["station_id"] for one in first["items"] + rest["items"]] == list("abcde")
    assert first["total"] == rest["total"]
    elsewhere = await ask(flown, "pads", "&network_id=other")
    assert (elsewhere["items"], elsewhere["total"]["utilisation"]) == ([], None)
    one = await ask(flown, "drones", "&limit=1")
    two = await ask(flown, "drones", f"&limit=1&cursor={one['next_cursor']}")
    assert [each["drone_id"] for each in one["items"] + two["items"]] == ["drn_1", "drn_2"]


async def test_without_flights_all_numbers_are_zero(composition: Any) -> None:
    found = (await composition(OPERATOR, "GET", "/v1/stats/drones")).json()
    assert (found["items"], found["total"]["drones"]) == ([], 0)
    assert found["total"]["utilisation"] is None


async def test_reported_steps_are_counted(composition: Any, drone: Any) -> None:
    await composition.book()
    [instruction] = await composition.sent()
    await composition.receive(drone.ack(instruction), *drone.flown(instruction))
    composition.clock.advance(timedelta(days=1))

    [used] = (await composition(OPERATOR, "GET", "/v1/stats/drones")).json()["items"]
    spent = {
        kind: sum(
            (step.planned_end_at - step.planned_start_at).total_seconds()
            for step in instruction.steps
            if step.kind == kind
        )
        for kind in ("FLY", "RECHARGE")
    }
    assert used["flying_s"] == pytest.approx(spent["FLY"], abs=0.01)
    assert used["recharging_s"] == pytest.approx(spent["RECHARGE"], abs=0.01)
    assert spent["FLY"] > 0


async def test_a_step_that_was_cut_short_is_counted_once(flown: Any) -> None:
    """drn_1 charged at d from 60 to 70, was cut short, and charged again from 75 to 80."""
    start_ms = moment_to_ms(flown.began_at)
    session = {
        "mission_id": "msn_2",
        "step_id": 2,
        "kind": "RECHARGE",
        "station_id": "d",
        "started_ms": start_ms + 60 * 60_000,
        "ended_ms": start_ms + 70 * 60_000,
    }
    await insert(flown, "cut_steps", seq=7, event="{}", **session)
    step = {"status": "ENDED", "step": "{}", "planned_start_ms": 0, "planned_end_ms": 0}
    await insert(flown, "mission_steps", revision=1, **step, **session)
    before = await ask(flown, "pads", to=120)
    async with flown.db.write() as tx:
        replaced = "DELETE FROM mission_steps WHERE mission_id = 'msn_2' AND step_id = 2"
        await tx.execute(text(replaced))
    later = {"started_ms": start_ms + 75 * 60_000, "ended_ms": start_ms + 80 * 60_000}
    await insert(flown, "mission_steps", revision=2, **step, **session | later)
    after = await ask(flown, "pads", to=120)

    assert [one["charging_s"] for one in before["items"]] == [0, 1800.0, 3600.0, 600.0, 0]
    assert [one["charging_s"] for one in after["items"]] == [0, 1800.0, 3600.0, 900.0, 0]
    assert after["items"][3]["sessions"] == 2
    drone = (await ask(flown, "drones", to=120))["items"][0]
    assert drone["recharging_s"] == (20 + 10 + 5) * 60.0
    # From the flight of its second mission at minute 50.
    assert drone["busy_s"] == (41 + 30) * 60.0
