"""Which missions a closure affects, by their planned steps and by their proposals."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import Proposal
from skyway_composition.missions.replanning.store import retry_stuck

from skyway.contracts.flight_step import FlyStep

OPERATOR = "operator:op"
WEST = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]]
AROUND_B = [[0.15, -0.1], [0.2, -0.1], [0.2, 0.1], [0.15, 0.1], [0.15, -0.1]]


def area(ring: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [ring]}


async def close(composition: Any, path: str, body: Any = None) -> list[Any]:
    """Make a closure; returns the affected missions, which a dry run must list too."""
    tried = await composition(OPERATOR, "POST", f"{path}?dry_run=true", body)
    made = await composition(OPERATOR, "POST", path, body)
    assert made.status_code == 201, made.text
    foreseen = [{**each, "delay": None} for each in tried.json()["affected_missions"]]
    assert foreseen == made.json()["affected_missions"]
    return foreseen


async def troubles(composition: Any) -> list[str | None]:
    async with composition.db.read() as connection:
        records = await store.page(connection, store.MissionFilter(), before=None, limit=100)
    return [None if each.trouble is None else each.trouble.code for each in records]


def on_board_of(booking: Any) -> Any:
    return booking.missions[0]


@pytest.mark.parametrize(
    ("path", "body", "code"),
    [
        ("/v1/stations/b/closures", {}, "STATION_CLOSED"),
        ("/v1/segments/a/b/closures", {}, "SEGMENT_CLOSED"),
        ("/v1/segments/c/b/closures", {}, "SEGMENT_CLOSED"),
        ("/v1/stations/b/pads/0/outages", {}, "PAD_OUT_OF_ORDER"),
        ("/v1/zones", {"network_id": "row", "area": area(AROUND_B)}, "ZONE_AHEAD"),
        ("/v1/ground-stops", {"reason": "storm"}, "GROUND_STOP"),
        (
            "/v1/ground-stops",
            {"reason": "storm", "provider_id": "prv_1", "drone_model_id": "paper-scenario"},
            "GROUND_STOP",
        ),
        (
            "/v1/ground-stops",
            {"reason": "storm", "network_id": "row", "area": area(WEST)},
            "GROUND_STOP",
        ),
    ],
)
async def test_a_mission_that_meets_a_closure_needs_another_plan(
    composition: Any, path: str, body: Any, code: str
) -> None:
    mission = on_board_of(await composition.book())

    (hit,) = await close(composition, path, body)

    assert (hit["mission_id"], hit["drone_id"]) == (mission.mission_id, "drn_1")
    assert (hit["provider_id"], hit["delivery_id"]) == ("prv_1", "dlv_1")
    assert hit["is_flying"] is False
    assert await troubles(composition) == [code]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/v1/stations/a/pads/1/outages", {}),
        ("/v1/stations/d/closures", {}),
        ("/v1/segments/c/d/closures", {}),
        ("/v1/stations/b/pads/1/outages", {}),
        ("/v1/ground-stops", {"reason": "storm", "provider_id": "prv_2"}),
        ("/v1/ground-stops", {"reason": "storm", "drone_model_id": "other"}),
        ("/v1/ground-stops", {"reason": "storm", "area": area(AROUND_B)}),
    ],
)
async def test_a_mission_that_does_not_meet_a_closure_keeps_its_plan(
    composition: Any, path: str, body: Any
) -> None:
    await composition.book()

    assert await close(composition, path, body) == []
    assert await troubles(composition) == [None]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_counts_only_in_its_time(composition: Any) -> None:
    mission = on_board_of(await composition.book())
    path = "/v1/stations/b/closures"
    lands_at = mission.start_at + timedelta(minutes=5)
    over_at = mission.released_at + timedelta(hours=1)

    before = await close(composition, path, {"until": lands_at.isoformat()})
    after = await close(composition, path, {"from_at": over_at.isoformat()})
    during = await close(
        composition, path, {"from_at": lands_at.isoformat(), "until": over_at.isoformat()}
    )

    assert (before, after) == ([], [])
    assert [each["mission_id"] for each in during] == [mission.mission_id]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_does_not_affect_an_ended_flight(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    ended = drone.flown(instruction)
    number = next(n for n, step in enumerate(instruction.steps) if step.kind == "FLY")
    await composition.receive(*ended[: number + 1])

    assert await close(composition, "/v1/segments/a/b/closures") == []
    assert await close(composition, "/v1/segments/b/c/closures") != []


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_affects_only_the_landing_of_a_flight_under_way(
    composition: Any, drone: Any
) -> None:
    mission = on_board_of(await composition.book())
    (instruction,) = await composition.sent()
    flight = next(step for step in instruction.steps if step.kind == "FLY")
    await composition.receive(
        drone.ack(instruction),
        drone.state(
            activity="FLYING",
            mission_id=mission.mission_id,
            mission_revision=1,
            step_id=flight.step_id,
            released_through=flight.step_id,
            station_id=None,
            last_instruction_seq=1,
        ),
    )

    assert await close(composition, "/v1/segments/a/b/closures") == []
    (hit,) = await close(composition, "/v1/stations/b/closures")
    assert (hit["station_id"], hit["is_flying"]) == ("b", True)


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_an_overdue_landing_is_still_to_come(composition: Any) -> None:
    mission = on_board_of(await composition.book())
    composition.clock.advance(timedelta(days=1))

    (hit,) = await close(composition, "/v1/stations/b/closures")

    assert hit["mission_id"] == mission.mission_id


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_affects_a_proposed_revision(composition: Any) -> None:
    mission = on_board_of(await composition.book())
    (instruction,) = await composition.sent()
    flight = next(step for step in instruction.steps if isinstance(step, FlyStep))
    async with composition.db.write() as tx:
        record = await store.get(tx.connection, mission.mission_id, provider_id=None)
        assert record is not None
        proposal = Proposal(
            instruction_id="ins_2",
            first_step=2,
            mission=record.mission,
            steps=(flight.model_copy(update={"from_id": "d", "to_id": "e"}),),
            code="LATE",
            detail="",
        )
        await store.save_all(tx, [replace(record, proposal=proposal)])

    (hit,) = await close(composition, "/v1/stations/e/closures")

    assert hit["mission_id"] == mission.mission_id


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_does_not_affect_an_ended_mission(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction, "REJECTED", code="OVERWEIGHT"))

    assert await close(composition, "/v1/stations/b/closures") == []


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_affected_missions_are_listed_in_the_order_of_their_hits(
    composition: Any, make: Any
) -> None:
    await composition.book(request=make.request("d"))
    await composition.book(make.candidate(2), delivery_id="dlv_2")

    hit = await close(composition, "/v1/stations/b/closures")

    assert {each["mission_id"] for each in hit} == {
        row.mission_id for row in await composition.rows("SELECT mission_id FROM missions")
    }
    assert [each["at"] for each in hit] == sorted(each["at"] for each in hit)


async def test_lifting_a_closure_plans_again_for_missions_without_a_plan(composition: Any) -> None:
    await composition.book()
    made = await composition(OPERATOR, "POST", "/v1/stations/b/closures")
    async with composition.db.write() as tx:
        (row,) = await composition.rows("SELECT mission_id FROM missions")
        await retry_stuck(tx, row.mission_id, at_wall_ms=10**15)

    await composition(OPERATOR, "DELETE", f"/v1/stations/b/closures/{made.json()['closure_id']}")

    assert await composition.rows("SELECT retry_wall_ms FROM missions") == [(0,)]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_closure_that_is_lifted_twice_stays_as_it_was_lifted_first(
    composition: Any,
) -> None:
    await composition.book()
    made = await composition(OPERATOR, "POST", "/v1/stations/b/closures")
    path = f"/v1/stations/b/closures/{made.json()['closure_id']}"
    await composition(OPERATOR, "DELETE", path)
    lifted = await composition.rows("SELECT lifted_ms FROM closures")
    async with composition.db.write() as tx:
        (row,) = await composition.rows("SELECT mission_id FROM missions")
        await retry_stuck(tx, row.mission_id, at_wall_ms=10**15)
    composition.clock.advance(timedelta(minutes=1))

    again = await composition(OPERATOR, "DELETE", path)

    assert again.status_code == 204
    assert await composition.rows("SELECT lifted_ms FROM closures") == lifted
    assert await composition.rows("SELECT retry_wall_ms FROM missions") == [(10**15,)]
