"""After a failsafe of a drone: composition plans on from there and raises alarms."""

import json
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.planning.problem_for import planned_more, used_more

from skyway.contracts.drone_report import DroneHealth, Wind
from skyway.contracts.flight_step import DeliverStep, PickUpStep, RechargeStep, ReturnStep
from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import flight_energy_j
from skyway.drone.models import PAPER_SCENARIO as MODEL
from skyway.geo import Position, distance_m
from skyway.units import moment_to_ms

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
IN_THE_OPEN = (0.05, 0.01)
B, C = Position(0.17986, 0.0), Position(2 * 0.17986, 0.0)


async def failed_at(
    composition: Any, drone: Any, failing: int, station_id: str | None, code: str, **members: Any
) -> Any:
    """The first instruction, after all steps before this one ended and this one failed."""
    await composition.book()
    (instruction,) = await composition.sent()
    before = drone.flown(instruction)[: failing - 1]
    drone.event_seq = failing - 1
    step = instruction.steps[failing - 1]
    composition.clock.advance(step.planned_start_at - composition.clock.now())
    failure = drone.event(
        "STEP_FAILED",
        mission_id=instruction.mission_id,
        mission_revision=1,
        step_id=failing,
        step_kind=step.kind,
        station_id=station_id,
        code=code,
        **members,
    )
    await composition.receive(drone.ack(instruction), *before, failure)
    return instruction


async def alarms(composition: Any) -> list[Any]:
    answer = await composition(OPERATOR, "GET", "/v1/alarms")
    return list(answer.json()["items"])


def health(consumption_factor: float, *, charging: float | None = None) -> DroneHealth:
    return DroneHealth(
        voltage_v=44.0,
        current_a=10.0,
        soc_error=0.01,
        cell_spread_v=0.01,
        temperature_c=20.0,
        state_of_health=1.0,
        consumption_factor=consumption_factor,
        charge_rate_factor=charging,
        range_m=10_000.0,
    )


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


def stands_at_b(drone: Any, mission: Any, **fields: Any) -> Any:
    """The state of a drone that stands at b with its package, before the flight of step 4."""
    return drone.state(
        mission_id=mission.mission_id,
        mission_revision=1,
        activity="WAITING",
        step_id=4,
        station_id="b",
        package_ids=("p1",),
        **fields,
    )


@pytest.mark.parametrize(("risk", "margin"), [(None, 0.35), (0.001, 0.45)])
async def test_a_drone_in_headwind_gets_a_plan_that_it_can_fly(
    composition: Any, drone: Any, make: Any, risk: float | None, margin: float
) -> None:
    # Without a forecast the largest margin (0.4) counts at this risk, and the drone needs more.
    await composition.publish(make.network(reserve_risk=risk))
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    in_wind = stands_at_b(drone, first, released_through=3, soc=0.6, health=health(1.31))
    await composition.receive(in_wind)

    await composition.replanner.step()

    shown = await composition(OPERATOR, "GET", f"/v1/missions/{first.mission_id}")
    mission = shown.json()["mission"]
    assert (mission["revision"], mission["margins"]["energy_margin"]) == (2, margin)
    assert ("risk" in mission["margins"]) == (risk is not None)
    (flight,) = [each for each in mission["plan"]["steps"] if each["kind"] == "FLY"]
    as_modelled_j = flight_energy_j(MODEL, length_m=distance_m(B, C), load_kg=0.4)
    assert flight["energy_j"] == pytest.approx((1 + margin) * as_modelled_j, rel=1e-3)
    revision = [each for each in await composition.sent() if each.kind == "MISSION"][-1]
    assert isinstance(revision.steps[0], RechargeStep)


@pytest.mark.parametrize(
    ("east_mps", "own", "margin"), [(-7.0, 1.0, 0.5), (7.0, 1.0, 0.15), (7.0, 1.31, 0.35)]
)
async def test_a_new_plan_has_the_energy_for_the_wind_that_the_drone_feels_and_for_calm_air(
    composition: Any, drone: Any, east_mps: float, own: float, margin: float
) -> None:
    first = await failed_at(composition, drone, 4, "b", "BATTERY_SHORT", soc=0.6, detail="short")
    wind = Wind(east_mps=east_mps, north_mps=0.0)
    felt = health(1.0).model_copy(update={"wind": wind, "still_air_factor": own})
    stands = stands_at_b(drone, first, released_through=4, soc=0.6, health=felt)
    await composition.receive(stands)

    await composition.replanner.step()

    shown = await composition(OPERATOR, "GET", f"/v1/missions/{first.mission_id}")
    assert shown.json()["mission"]["margins"]["energy_margin"] == margin


async def test_a_drone_that_refuses_for_lack_of_energy_gets_a_plan_with_more_a_minute_later(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    stands = stands_at_b(drone, first, released_through=3, soc=0.6)
    await composition.receive(stands)

    margins = []
    for _ in range(3):
        composition.clock.advance(timedelta(minutes=1))
        await composition.replanner.step()
        *_, revision = await composition.sent()
        shown = await composition(OPERATOR, "GET", f"/v1/missions/{revision.mission_id}")
        margins.append(shown.json()["mission"]["margins"]["energy_margin"])
        refusal = drone.ack(revision, status="REJECTED", code="INSUFFICIENT_ENERGY")
        await composition.receive(refusal)
        await composition.replanner.step()
        assert (await composition.sent())[-1:] in ([], [revision])

    assert margins == pytest.approx([0.2, 0.25, 0.3])


@pytest.mark.long
@pytest.mark.parametrize(("others", "last"), [(0, "ABORTED"), (9, "ACTIVE")])
async def test_a_drone_that_refuses_ten_plans_in_a_row_for_lack_of_energy_is_given_up(
    composition: Any, drone: Any, others: int, last: str
) -> None:
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    await composition.receive(stands_at_b(drone, first, released_through=3, soc=0.6))

    states = []
    for number in range(10):
        composition.clock.advance(timedelta(minutes=1))
        await composition.replanner.step()
        *_, revision = await composition.sent()
        code = "EXPIRED" if number < others else "INSUFFICIENT_ENERGY"
        await composition.receive(drone.ack(revision, status="REJECTED", code=code))
        states.append(await composition.state_of(first.mission_id))

    assert states == ["ACTIVE"] * 9 + [last]
    given_up = [("URGENT", "REVISIONS_REFUSED")] if last == "ABORTED" else []
    assert [(each["level"], each["code"]) for each in await alarms(composition)] == given_up
    assert (await composition.reservations() == []) == bool(given_up)
    assert await composition.broken() == []


@pytest.mark.parametrize(("charging", "longer"), [(None, 1.0), (1.1, 1.0), (0.5, 2.0)])
async def test_a_drone_that_reports_slow_charging_gets_longer_sessions_in_its_next_plan(
    composition: Any, drone: Any, charging: float | None, longer: float
) -> None:
    first = await failed_at(
        composition, drone, 4, "b", "BATTERY_SHORT", soc=0.3, detail="too little"
    )
    stands = stands_at_b(
        drone, first, released_through=4, soc=0.3, health=health(1.0, charging=charging)
    )
    await composition.receive(stands)

    await composition.replanner.step()

    (revision,) = await composition.sent()
    session = revision.steps[0]
    planned_s = (session.planned_end_at - session.planned_start_at).total_seconds()
    by_model_s = recharge_time_s(MODEL, 0.3, session.until_soc)
    assert planned_s == pytest.approx(longer * by_model_s, rel=1e-3)


@pytest.mark.parametrize(
    ("factor", "used", "planned"),
    [(0.9, 0.0, 0.0), (1.02, 0.0, 0.0), (1.03, 0.03, 0.05), (1.31, 0.31, 0.35), (9.0, 3.0, 3.05)],
)
def test_higher_energy_use_is_planned_with_headroom_within_bounds(
    migrated_url: str, factor: float, used: float, planned: float
) -> None:
    assert used_more(factor) == pytest.approx(used)
    assert planned_more(factor) == pytest.approx(planned)


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
