"""After a failsafe of a drone: composition plans on from there and raises alarms."""

import json
from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import DeliverStep, PickUpStep, RechargeStep, ReturnStep
from skyway.geo import Position
from skyway.units import moment_to_ms
from tests.composition.missions.replanning.failed_step import alarms, failed_at, health

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
IN_THE_OPEN = (0.05, 0.01)
B, C = Position(0.17986, 0.0), Position(2 * 0.17986, 0.0)


async def test_the_mission_continues_from_where_a_failsafe_led_the_drone(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(
        composition, drone, 4, "b", "BATTERY_SHORT", soc=0.3, energy_j=9_000.0, detail="too little"
    )
    assert (first.steps[3].kind, first.steps[3].to_id) == ("FLY", "c")

    await composition.replanner.step()

    (revision,) = await composition.sent()
    charge, *onward = revision.steps
    assert (charge.kind, charge.station_id, charge.step_id) == ("RECHARGE", "b", 5)
    assert [each.package_ids for each in onward if isinstance(each, DeliverStep)] == [("p1",)]
    report = (await composition.reports())[-1]
    words = "the drone went back to 'b' on its way to 'c': too little"
    assert (report.kind, report.code, report.detail) == ("REPLANNED", "BATTERY_SHORT", words)
    assert await composition.broken() == []


async def test_pads_that_the_drone_no_longer_needs_are_released(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(composition, drone, 2, "a", "GEOFENCE", soc=0.9, energy_j=9_000.0)
    (old,) = [each for each in first.steps if isinstance(each, RechargeStep)][:1]

    await composition.replanner.step()

    (revision,) = await composition.sent()
    sessions = [each for each in revision.steps if isinstance(each, RechargeStep)]
    planned = {(each.station_id, moment_to_ms(each.not_before_at)) for each in sessions}
    held = {(row.station_id, row.start_ms) for row in await composition.reservations()}
    assert held == planned
    assert (old.station_id, moment_to_ms(old.not_before_at)) not in held


async def test_a_forced_landing_ends_the_mission_with_the_packages_on_board(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(
        composition, drone, 4, None, "MOTOR_FAILURE", position=IN_THE_OPEN, detail="a motor stopped"
    )

    assert await composition.state_of(first.mission_id) == "ABORTED"
    ended = (await composition.reports())[-1]
    assert (ended.kind, ended.code, ended.station_id) == ("ENDED", "MOTOR_FAILURE", None)
    assert (ended.stranded_package_ids, ended.position) == (("p1",), IN_THE_OPEN)
    custody = await composition.rows("SELECT custodian_kind, custodian_id FROM custody")
    assert [tuple(row) for row in custody][-1] == ("DRONE", "drn_1")
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_an_alarm_says_where_a_drone_has_landed_in_the_open(
    composition: Any, drone: Any
) -> None:
    await failed_at(composition, drone, 4, None, "MOTOR_FAILURE", position=IN_THE_OPEN)

    (alarm,) = await alarms(composition)

    assert (alarm["level"], alarm["code"], alarm["provider_id"]) == (
        "CRITICAL",
        "FORCED_LANDING",
        "prv_1",
    )
    assert "0.01000, 0.05000" in alarm["detail"]
    assert alarm["data"]["package_ids"] == ["p1"]
    track = await composition("service:gateway", "GET", "/internal/deliveries/dlv_1/track")
    (mission,) = track.json()["missions"]
    assert mission["position"] == list(IN_THE_OPEN)


async def test_a_drone_that_landed_in_the_open_is_not_booked(composition: Any, drone: Any) -> None:
    await failed_at(composition, drone, 4, None, "MOTOR_FAILURE", position=IN_THE_OPEN)

    await composition.receive(drone.state(activity="DOWN", station_id=None, position=IN_THE_OPEN))
    down = await composition.book(delivery_id="dlv_2")
    await composition.receive(drone.state(activity="IDLE", station_id="a"))
    fetched = await composition.book(delivery_id="dlv_2", attempt=2)

    assert (down.outcome, fetched.outcome) == ("BUSY", "BOOKED")


async def test_a_drone_that_landed_in_the_open_gets_a_cancel(composition: Any, drone: Any) -> None:
    first = await failed_at(composition, drone, 4, None, "MOTOR_FAILURE", position=IN_THE_OPEN)

    await composition.receive(
        drone.state(
            activity="DOWN",
            station_id=None,
            position=IN_THE_OPEN,
            mission_id=first.mission_id,
            mission_revision=1,
            stream=first.stream,
        )
    )

    assert (await composition.sent())[-1].kind == "CANCEL"


async def test_an_occupied_pad_is_out_of_order_for_a_quarter_of_an_hour(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(composition, drone, 3, "b", "PAD_OCCUPIED", soc=0.5)
    pad = first.steps[2].pad

    await composition.replanner.step()

    (outage,) = (await composition(OPERATOR, "GET", f"/v1/stations/b/pads/{pad}/outages")).json()[
        "items"
    ]
    assert outage["reason"] == "drone drn_1 found it occupied"
    rows = await composition.rows("SELECT from_ms, until_ms FROM closures")
    assert [row.until_ms - row.from_ms for row in rows] == [900_000]
    (revision,) = await composition.sent()
    charge = revision.steps[0]
    assert (charge.kind, charge.station_id) == ("RECHARGE", "b")
    assert charge.pad != pad
    assert await composition.broken() == []


@pytest.mark.parametrize(("faults", "is_left_to_wait"), [(("PAD_OCCUPIED",), True), ((), False)])
async def test_a_drone_that_waits_for_an_occupied_pad_requests_a_plan_itself(
    composition: Any, drone: Any, faults: tuple[str, ...], is_left_to_wait: bool
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    *flown, charge = instruction.steps[:3]
    await composition.receive(drone.ack(instruction))
    for step in flown:
        composition.clock.advance(step.planned_end_at - composition.clock.now())
        await composition.receive(*drone.ended(instruction, [step], soc=0.9))
    late_at = charge.planned_end_at + timedelta(minutes=2)
    composition.clock.advance(late_at - composition.clock.now())
    charging = drone.state(
        mission_id=instruction.mission_id,
        mission_revision=1,
        activity="RECHARGING",
        step_id=3,
        released_through=3,
        station_id="b",
        package_ids=("p1",),
        faults=faults,
        soc=0.2,
    )

    # It has charged nothing so far, and its time on the pad is over.
    await composition.receive(charging)
    await composition.late_missions.step()

    rows = await composition.rows("SELECT trouble FROM missions")
    assert (rows[0].trouble is None) is is_left_to_wait


async def test_a_drone_waits_for_the_only_pad_that_is_occupied(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    await failed_at(composition, drone, 3, "b", "PAD_OCCUPIED", soc=0.3)
    until_ms = moment_to_ms(composition.clock.now()) + 900_000

    await composition.replanner.step()

    (revision,) = await composition.sent()
    charge = next(each for each in revision.steps if isinstance(each, RechargeStep))
    assert moment_to_ms(charge.not_before_at) >= until_ms


async def test_another_drone_planned_for_an_occupied_pad_gets_another_plan(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    first = await failed_at(composition, drone, 3, "b", "PAD_OCCUPIED", soc=0.3)
    await composition.book(make.candidate(2), delivery_id="dlv_2")
    held = [row.mission_id for row in await composition.reservations() if row.station_id == "b"]
    assert len(set(held)) == 2

    await composition.replanner.step()

    rows = await composition.rows("SELECT mission_id, trouble FROM missions WHERE drone_id='drn_2'")
    soon = [row for row in await composition.reservations() if row.mission_id != first.mission_id]
    is_hit = json.loads(rows[0].trouble or "{}").get("code") == "PAD_OUT_OF_ORDER"
    until_ms = moment_to_ms(composition.clock.now()) + 900_000
    assert is_hit == any(row.station_id == "b" and row.start_ms < until_ms for row in soon)


async def test_packages_that_may_have_been_delivered_return_and_raise_an_alarm(
    composition: Any, drone: Any
) -> None:
    await failed_at(composition, drone, 5, "c", "UNKNOWN", soc=0.9)

    await composition.replanner.step()

    (revision,) = await composition.sent()
    (back,) = [each for each in revision.steps if isinstance(each, ReturnStep)]
    assert (back.station_id, back.package_ids) == ("a", ("p1",))
    assert not any(isinstance(each, DeliverStep) for each in revision.steps)
    (alarm,) = await alarms(composition)
    assert (alarm["level"], alarm["code"], alarm["station_id"]) == (
        "URGENT",
        "HAND_OVER_UNKNOWN",
        "c",
    )


@pytest.mark.parametrize("is_on_board", [False, True])
async def test_packages_that_may_have_been_loaded_count_as_the_drone_reports(
    composition: Any, drone: Any, is_on_board: bool
) -> None:
    named = ("p1",) if is_on_board else ()
    await failed_at(composition, drone, 1, "a", "UNKNOWN", soc=1.0, package_ids=named)

    await composition.replanner.step()

    custody = await composition.rows("SELECT custodian_kind FROM custody ORDER BY seq")
    kept = ["STATION", "DRONE"] if is_on_board else ["STATION"]
    assert [row.custodian_kind for row in custody] == kept
    (revision,) = await composition.sent()
    assert isinstance(revision.steps[0], PickUpStep) != is_on_board
    assert [each["code"] for each in await alarms(composition)] == ["HAND_OVER_UNKNOWN"]


async def test_a_predicted_landing_below_the_reserve_requests_no_plan(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (first,) = await composition.sent()
    loaded = drone.flown(first)[:1]
    drone.event_seq = 1
    composition.clock.advance(first.steps[0].planned_end_at - composition.clock.now())
    will_be_short = drone.state(
        mission_id=first.mission_id,
        mission_revision=1,
        activity="FLYING",
        step_id=2,
        released_through=2,
        station_id=None,
        package_ids=("p1",),
        soc=0.3,
        health=health(1.5),
    )

    await composition.receive(drone.ack(first), *loaded, will_be_short)

    assert "REPLANNING" not in [each.kind for each in await composition.reports()]
    assert first.steps[2].kind == "RECHARGE"
