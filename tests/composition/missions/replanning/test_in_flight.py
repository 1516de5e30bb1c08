"""Changes during a flight: the drone gets another plan, or lands where it is safest."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import FlyStep, RechargeStep, ReturnStep

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"

#: With twice the scenario's battery a drone flies over a station, and lands at the one after it.
FOR_TWO_FLIGHTS_J = 1_800_000.0


async def take_off(
    composition: Any,
    drone: Any,
    *destinations: str,
    make: Any,
    request: Any = None,
    **model: Any,
) -> Any:
    """The instruction of a drone that has begun its first flight."""
    candidate = make.candidate()
    candidate = candidate.model_copy(update={"model": candidate.model.model_copy(update=model)})
    await composition.book(candidate, request=request or make.request(*destinations))
    (instruction,) = await composition.sent()
    pick_up = instruction.steps[0]
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    await composition.receive(
        drone.ack(instruction), *drone.ended(instruction, [pick_up]), flying(drone, instruction, 2)
    )
    return instruction


def flying(drone: Any, instruction: Any, step_id: int, **members: Any) -> Any:
    """The state of a drone on this flight; all steps up to its next landing are released."""
    landing = next(
        step.step_id
        for step in instruction.steps
        if isinstance(step, FlyStep) and step.lands and step.step_id >= step_id
    )
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "activity": "FLYING",
        "step_id": step_id,
        "released_through": landing,
        "station_id": None,
        "package_ids": ("p1",),
        **members,
    }
    return drone.state(**values)


async def close(composition: Any, station_id: str) -> None:
    answer = await composition(
        OPERATOR, "POST", f"/v1/stations/{station_id}/closures", {"reason": "a storm"}
    )
    assert answer.status_code == 201, answer.text


async def kinds(composition: Any) -> list[str]:
    return [report.kind for report in await composition.reports()]


async def test_a_drone_lands_before_a_closed_station(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "e", make=make, battery_j=FOR_TWO_FLIGHTS_J)
    over, landing = first.steps[1:3]
    assert (over.to_id, over.lands, landing.to_id, landing.lands) == ("b", False, "c", True)

    await close(composition, "c")
    await composition.replanner.step()

    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step, divert.steps[0].step_id) == ("DIVERT", 2, 3)
    assert divert.steps[0].station_id == "b"
    landings = [step.to_id for step in divert.steps if isinstance(step, FlyStep) and step.lands]
    assert "c" not in landings
    await composition.receive(drone.ack(divert))
    assert (await composition.reports())[-1].kind == "REPLANNED"
    assert await composition.broken() == []


async def test_a_drone_lands_before_a_station_whose_pad_is_out_of_order(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "e", make=make, battery_j=FOR_TWO_FLIGHTS_J)
    over, landing, recharge = first.steps[1:4]
    assert (over.to_id, over.lands, landing.lands) == ("b", False, True)
    assert (recharge.kind, recharge.station_id) == ("RECHARGE", "c")

    for pad in range(2):
        outages = f"/v1/stations/c/pads/{pad}/outages"
        answer = await composition(OPERATOR, "POST", outages, {"reason": "no power"})
        assert answer.status_code == 201, answer.text
    await composition.replanner.step()

    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step) == ("DIVERT", 2)
    assert (divert.steps[0].kind, divert.steps[0].station_id) == ("RECHARGE", "b")
    assert [step.kind for step in divert.steps].count("DELIVER") == 1
    assert await composition.broken() == []


async def test_packages_go_back_when_their_recipient_cannot_be_reached(
    composition: Any, drone: Any, make: Any
) -> None:
    await take_off(composition, drone, "c", make=make)

    await close(composition, "c")
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert (revision.kind, revision.first_step) == ("MISSION", 3)
    (back,) = [step for step in revision.steps if isinstance(step, ReturnStep)]
    assert (back.station_id, back.package_ids) == ("a", ("p1",))
    assert (await kinds(composition))[-1] == "RETURNING"


async def test_a_package_goes_to_its_alternative_when_its_destination_is_closed(
    composition: Any, drone: Any, make: Any
) -> None:
    request = make.request("c")
    alternative = {"station_id": "b"}
    package = request.packages[0].model_copy(
        update={"alternative": type(request.pickup).model_validate(alternative)}
    )
    request = request.model_copy(update={"packages": (package,)})
    await take_off(composition, drone, make=make, request=request)

    await close(composition, "c")
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert [step.kind for step in revision.steps][:1] == ["DELIVER"]
    assert revision.steps[0].station_id == "b"
    assert "RETURNING" not in await kinds(composition)


async def test_a_drone_without_another_landing_lands_at_the_closed_station(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "c", make=make)

    await close(composition, "b")
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert (revision.kind, revision.first_step) == ("MISSION", 3)
    assert [(step.kind, step.station_id) for step in revision.steps] == [("RETURN", "b")]
    alarms = await composition.rows("SELECT level, code FROM alarms")
    assert [tuple(row) for row in alarms] == [("CRITICAL", "NO_SAFE_LANDING")]

    await composition.receive(drone.ack(revision))
    replanned = (await composition.reports())[-1]
    assert (replanned.kind, replanned.mission.given_up) == ("REPLANNED", "OUT_OF_RANGE")
    assert (replanned.etas, replanned.mission.packages) == ((), ())

    # Its state comes last, so that only its events say where it stands.
    await composition.receive(*drone.ended(first, [first.steps[1]]), *drone.flown(revision))

    report = (await composition.reports())[-1]
    assert (report.kind, report.mission_state) == ("ENDED", "ABORTED")
    assert (report.stranded_package_ids, report.station_id) == (("p1",), "b")
    assert report.detail == "no way was left to deliver or return 1 packages"
    chain = await composition.rows("SELECT custodian_kind, custodian_id FROM custody ORDER BY seq")
    assert tuple(chain[-1]) == ("STATION", "b")
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_drone_over_a_closed_station_lands_at_the_next_station_in_reach(
    composition: Any, drone: Any, make: Any
) -> None:
    await take_off(composition, drone, "b", make=make, battery_j=FOR_TWO_FLIGHTS_J)

    await close(composition, "b")
    await composition.replanner.step()

    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step) == ("DIVERT", 2)
    assert divert.steps[0].kind == "FLY"
    assert await composition.rows("SELECT code FROM alarms") == []


async def test_a_late_drone_gets_another_plan_before_its_pad_is_lost(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "c", make=make)
    recharge = first.steps[2]
    assert isinstance(recharge, RechargeStep)
    # Its reports may be on their way for half a minute.
    late = timedelta(seconds=30)
    composition.clock.advance(recharge.not_after_at + late - composition.clock.now())

    await composition.late_missions.step()

    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("REPLANNING", "LATE")
    assert "pad" in (report.detail or "")


async def test_the_energy_margin_covers_a_tolerated_delay(
    composition: Any, drone: Any, make: Any
) -> None:
    """A minute late, the drone charges a little less than planned, which is still enough."""
    first = await take_off(composition, drone, "c", make=make)
    flight = first.steps[1]
    late_at = flight.planned_end_at + timedelta(seconds=60)
    composition.clock.advance(late_at - composition.clock.now())
    await composition.receive(
        flying(drone, first, 2, at=late_at, position=flight.to_position, soc=0.24)
    )

    await composition.late_missions.step()

    assert "REPLANNING" not in await kinds(composition)


async def test_a_drone_that_used_too_much_energy_gets_another_plan(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "c", make=make)

    # Its charge is low, and the recharge session is too short for the missing charge.
    await composition.receive(*drone.ended(first, [first.steps[1]], soc=0.62))

    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("REPLANNING", "MORE_ENERGY")


async def charge_short(
    composition: Any, drone: Any, *, make: Any, lacking_soc: float, faults: tuple[str, ...] = ()
) -> None:
    """The drone's first recharge, begun with these faults, ends short by this charge."""
    first = await take_off(composition, drone, "c", make=make)
    flight, recharge = first.steps[1:3]
    await composition.receive(*drone.ended(first, [flight]))
    charging = drone.state(
        mission_id=first.mission_id,
        mission_revision=1,
        activity="RECHARGING",
        step_id=3,
        released_through=3,
        station_id="b",
        package_ids=("p1",),
        faults=faults,
        soc=0.3,
    )
    await composition.receive(charging)
    composition.clock.advance(recharge.planned_end_at - composition.clock.now())
    (short,) = drone.ended(first, [recharge], soc=0.3)
    soc = recharge.until_soc - lacking_soc
    message = short.message.model_copy(update={"code": "SHORT_CHARGE", "soc": soc})
    await composition.receive(type(short)(short.topic, short.ids, message, retained=False))


@pytest.mark.parametrize("faults", [(), ("PAD_OCCUPIED",)])
async def test_a_short_charge_leads_to_another_plan(
    composition: Any, drone: Any, make: Any, faults: tuple[str, ...]
) -> None:
    await charge_short(composition, drone, make=make, lacking_soc=0.2, faults=faults)

    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("REPLANNING", "SHORT_CHARGE")


async def test_a_short_charge_that_is_still_enough_changes_nothing(
    composition: Any, drone: Any, make: Any
) -> None:
    await charge_short(composition, drone, make=make, lacking_soc=0.0005)

    assert "REPLANNING" not in await kinds(composition)


async def test_a_late_message_does_not_make_a_drone_late(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "c", make=make)
    flight, recharge = first.steps[1:3]
    # A message that took 0.6 s of wall time: the drone charges by now, though not reported yet.
    composition.clock.rate = 1000.0
    late = timedelta(seconds=600)
    composition.clock.advance(recharge.not_before_at + late - composition.clock.now())

    await composition.receive(*drone.ended(first, [flight]))

    assert "REPLANNING" not in await kinds(composition)


async def test_a_drone_may_request_another_plan(composition: Any, drone: Any, make: Any) -> None:
    first = await take_off(composition, drone, "c", make=make)
    asks = drone.event("ALARM", mission_id=first.mission_id, code="PLAN_WANTED", detail="head wind")

    await composition.receive(asks)
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert revision.mission_revision == 2
    assert [row.code for row in await composition.rows("SELECT code FROM alarms")] == [
        "PLAN_WANTED"
    ]


async def test_a_package_goes_back_when_its_recipient_is_absent(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await take_off(composition, drone, "c", make=make)
    *before, deliver = first.steps[1:5]
    absent = drone.ended(first, before)
    failure = drone.event(
        "STEP_FAILED",
        mission_id=first.mission_id,
        step_id=deliver.step_id,
        station_id="c",
        soc=0.1,
        code="RECIPIENT_ABSENT",
    )

    await composition.receive(*absent, failure)
    await composition.replanner.step()

    (revision,) = await composition.sent()
    (back,) = [step for step in revision.steps if isinstance(step, ReturnStep)]
    assert (back.station_id, back.package_ids) == ("a", ("p1",))
    reports = [(each.kind, each.code) for each in await composition.reports()][-3:]
    assert reports == [
        ("RETURNING", "RECIPIENT_ABSENT"),
        ("REPLANNING", "RECIPIENT_ABSENT"),
        ("REPLANNED", "RECIPIENT_ABSENT"),
    ]
    assert (await composition.reports())[-1].detail == "no recipient took p1 at 'c' within 300 s"


def with_window(request: Any, **limits: Any) -> Any:
    """The request with this window for its first package."""
    first, *others = request.packages
    return request.model_copy(update={"packages": (first.model_copy(update=limits), *others)})


async def test_a_package_whose_window_has_passed_is_still_delivered(
    composition: Any, drone: Any, make: Any
) -> None:
    latest_at = composition.clock.now() + timedelta(hours=2)
    request = with_window(make.request("c"), latest_at=latest_at)
    instruction = await take_off(composition, drone, make=make, request=request)
    composition.clock.advance(timedelta(hours=3))
    await composition.receive(flying(drone, instruction, 2))

    await composition.replanner.step()

    (revision,) = await composition.sent()
    delivered = [step for step in revision.steps if step.kind == "DELIVER"]
    assert [(step.station_id, step.package_ids) for step in delivered] == [("c", ("p1",))]
    assert delivered[0].planned_end_at > latest_at


async def test_a_new_plan_still_waits_for_the_window_of_a_package(
    composition: Any, drone: Any, make: Any
) -> None:
    now = composition.clock.now()
    opens_at = now + timedelta(hours=4)
    request = with_window(make.request("b", "c"), latest_at=now + timedelta(minutes=20))
    near, far = request.packages
    far = far.model_copy(update={"not_before_at": opens_at})
    request = request.model_copy(update={"packages": (near, far)})
    instruction = await take_off(composition, drone, make=make, request=request)
    composition.clock.advance(timedelta(minutes=40))
    await composition.receive(flying(drone, instruction, 2, package_ids=("p1", "p2")))

    await composition.replanner.step()

    (revision,) = await composition.sent()
    late, waiting = [step for step in revision.steps if step.kind == "DELIVER"]
    assert (late.package_ids, waiting.package_ids) == (("p1",), ("p2",))
    assert late.planned_end_at > now + timedelta(minutes=40)
    assert waiting.planned_start_at == opens_at


async def test_a_drone_that_comes_after_closing_time_hands_over_when_its_station_opens_again(
    composition: Any, drone: Any, make: Any
) -> None:
    network = make.network()
    for feature in network["features"]:
        if feature["properties"].get("station_id") == "b":
            # The clock begins on a Sunday at 12:00.
            spans = {"sun": ["12:00-12:30", "15:00-16:00"]}
            feature["properties"]["opening_hours"] = {"weekly": spans}
    await composition.publish(network)
    instruction = await take_off(composition, drone, make=make, request=make.request("b"))
    now = composition.clock.now()
    delivered = next(step for step in instruction.steps if step.kind == "DELIVER")
    assert delivered.planned_end_at < now.replace(hour=12, minute=30)
    composition.clock.advance(timedelta(minutes=29))
    await composition.receive(flying(drone, instruction, 2))

    await composition.replanner.step()

    revision = [each for each in await composition.sent() if hasattr(each, "steps")][-1]
    late = next(step for step in revision.steps if step.kind == "DELIVER")
    assert late.station_id == "b"
    assert late.planned_start_at == now.replace(hour=15, minute=0, second=0, microsecond=0)


async def test_a_drone_lands_before_wind_above_its_limit_and_waits_there(
    composition: Any, drone: Any, make: Any
) -> None:
    limits = {"battery_j": FOR_TWO_FLIGHTS_J, "max_wind_mps": 6.0}
    first = await take_off(composition, drone, "e", make=make, **limits)
    over, landing = first.steps[1:3]
    assert (over.to_id, over.lands, landing.to_id, landing.lands) == ("b", False, "c", True)

    now = composition.clock.now()
    wind = {"valid_at": now.isoformat(), "wind_speed_mps": 7.0, "wind_from_deg": 0.0}
    reports = [{"station_id": station, **wind} for station in "ace"]
    forecast = {"source": "a mast", "issued_at": now.isoformat(), "reports": reports}
    answer = await composition(OPERATOR, "PUT", "/v1/networks/row/weather", forecast)
    assert answer.status_code == 200, answer.text
    await composition.replanner.step()

    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step) == ("DIVERT", 2)
    assert divert.steps[0].station_id == "b"
    flights = [step for step in divert.steps if isinstance(step, FlyStep)]
    # An hour later half of the wind is left.
    assert min(step.planned_start_at for step in flights) >= now + timedelta(hours=1)
    assert {step.time_factor > 1.0 for step in flights} == {True}
    await composition.receive(drone.ack(divert))
    assert (await composition.reports())[-1].mission.weather.source == "a mast"
    assert await composition.broken() == []
