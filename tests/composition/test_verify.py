"""`verify` finds each invariant that is broken."""

from typing import Any

import pytest
from sqlalchemy import text

from skyway.contracts.flight_step import FlyStep
from skyway.units import moment_to_ms

BREAKS = {
    "I1 no pad holds two overlapping reservations": [
        "DROP TRIGGER pad_taken_on_insert",
        (
            "INSERT INTO pad_reservations (station_id, pad, start_ms, end_ms, mission_id) "
            "SELECT station_id, pad, start_ms + 1, end_ms, mission_id "
            "FROM pad_reservations WHERE station_id = 'b' AND pad = 0"
        ),
    ],
    "I2 a drone is on at most one mission": [
        "DROP INDEX mission_drone",
        (
            "INSERT INTO missions (mission_id, delivery_id, attempt, trip, provider_id, drone_id, "
            "state, network_id, start_ms, served_ms, released_ms, expires_ms, body, request, "
            "candidate, "
            "report_seq, told, stuck, retry_wall_ms, claimed_by, claimed_until_ms) "
            "SELECT 'msn_x', delivery_id, 2, trip, provider_id, drone_id, "
            "state, network_id, start_ms, served_ms, released_ms, expires_ms, body, request, "
            "candidate, "
            "report_seq, told, stuck, retry_wall_ms, claimed_by, claimed_until_ms FROM missions"
        ),
    ],
    "I3 a reservation has a mission that is not over": ["UPDATE missions SET state = 'COMPLETED'"],
    "I3 a mission holds the pads of its steps": [
        "DELETE FROM pad_reservations WHERE station_id = 'c'"
    ],
    "I3 a mission holds no pad that it does not need": [
        "UPDATE pad_reservations SET end_ms = end_ms + 1 WHERE station_id = 'c'"
    ],
    "a no-show is a mission of its provider that was refused or aborted": [
        "INSERT INTO no_shows SELECT mission_id, provider_id, drone_id, 'SILENT', 1 FROM missions"
    ],
    "I4 a mission was sent to its drone": ["DELETE FROM instructions"],
    "I4 a mission has steps": ["DELETE FROM mission_steps"],
    "a mission is checked when its next step should have ended": [
        "UPDATE missions SET state = 'ACCEPTED', next_end_ms = 1"
    ],
    "a closed delivery has no mission that is not over": ["UPDATE deliveries SET closed_ms = 1"],
    "a withdrawn attempt has no mission that is not over": [
        "UPDATE deliveries SET withdrawn_attempt = 1"
    ],
    "I7 an unanswered instruction follows the one before it": ["UPDATE instructions SET seq = 3"],
    "I6 a chain of custody has no gaps": ["UPDATE custody SET seq = 2"],
    "I6 a package is delivered once": [
        "DROP INDEX custody_delivered",
        *(
            "INSERT INTO custody SELECT delivery_id, package_id, "
            f"{seq}, 'RECIPIENT', 'c', mission_id, at_ms FROM custody WHERE seq = 1"
            for seq in (2, 3)
        ),
    ],
    "I6 a package that a cancellation released is not delivered": [
        (
            "INSERT INTO cancellations VALUES "
            """('dlv_1', 'cnl_1', '{"released": ["p1"]}', 1)"""
        ),
        (
            "INSERT INTO custody SELECT delivery_id, package_id, 2, 'RECIPIENT', 'c', "
            "mission_id, at_ms FROM custody"
        ),
    ],
    "I6 nothing follows the recipient": [
        (
            "INSERT INTO custody SELECT delivery_id, package_id, 2, 'DRONE', 'd', mission_id, "
            "at_ms FROM custody"
        ),
        "UPDATE custody SET custodian_kind = 'RECIPIENT' WHERE seq = 1",
    ],
    "I12 a current version is kept": ["UPDATE networks SET version = 7"],
}


async def test_a_sound_database_has_no_violation(composition: Any) -> None:
    await composition.book()

    assert await composition.broken() == []


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("rule", BREAKS)
async def test_a_broken_rule_is_named(composition: Any, rule: str) -> None:
    await composition.book()
    async with composition.db.write() as tx:
        for statement in BREAKS[rule]:
            await tx.execute(text(statement))

    broken = await composition.broken()

    assert rule in {name for name, _ in broken}


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("has_begun", [False, True])
async def test_only_a_flight_that_has_begun_may_use_what_is_closed(
    composition: Any, drone: Any, has_begun: bool
) -> None:
    await composition.receive(drone.state(stream=0))
    await composition.book()
    (instruction,) = await composition.sent()
    flight = next(each for each in instruction.steps if isinstance(each, FlyStep))
    state = drone.state(
        mission_id=instruction.mission_id,
        mission_revision=1,
        activity="FLYING" if has_begun else "WAITING",
        step_id=flight.step_id,
        released_through=flight.step_id if has_begun else flight.step_id - 1,
    )
    await composition.receive(drone.ack(instruction), state)
    made_ms = moment_to_ms(flight.planned_start_at) - 1
    async with composition.db.write() as tx:
        columns = "closure_id, kind, network_id, station_id, to_station_id, from_ms, made_ms"
        ends = f"'{flight.from_id}', '{flight.to_id}'"
        values = f"'cls_1', 'SEGMENT', 'row', {ends}, {made_ms}, {made_ms}"
        await tx.execute(text(f"INSERT INTO closures ({columns}) VALUES ({values})"))

    broken = await composition.broken()

    assert ("I11 no live plan uses what is closed" in {name for name, _ in broken}) != has_begun
