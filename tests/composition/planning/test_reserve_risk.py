"""`reserve_risk` of a network: the energy margin of each flight follows from it."""

import asyncio
import math
from dataclasses import replace
from datetime import timedelta
from threading import get_ident
from typing import Any

import numpy as np
import pytest
from skyway_composition.closures.network_weather import NetworkWeather
from skyway_composition.planning.lower_bounds import LowerBounds
from skyway_composition.planning.world import ClosedAhead, World
from skyway_drone_agent.flying.step_checks import shortfall_of

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.quote import QuoteQuery
from skyway.contracts.shortlist import Shortlist
from skyway.drone.flight import flight_energy_j
from skyway.drone.learned_values import UNKNOWN_USE
from skyway.drone.model import DroneModel
from skyway.planner.energy_risk import MODEL_DEVIATION, EnergyRisk
from skyway.planner.weather import Weather
from skyway.units import moment_to_ms
from tests.composition.planning.test_plan_offers import offers_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


async def forecast(composition: Any, *, error_mps: float | None = 1.0) -> None:
    """A day of wind from the east, 2 m/s."""
    now = composition.clock.now()
    values: dict[str, Any] = {"wind_speed_mps": 2.0, "wind_from_deg": 90.0}
    if error_mps is not None:
        values["error_mps"] = error_mps
    moments = [(now + timedelta(hours=hour)).isoformat() for hour in range(24)]
    reports = [{"station_id": "c", "valid_at": moment} | values for moment in moments]
    body = {"source": "test", "issued_at": now.isoformat(), "reports": reports}
    answer = await composition(OPERATOR, "PUT", "/v1/networks/row/weather", body)
    assert answer.status_code == 200, answer.text


async def booked(composition: Any, drone: Any) -> tuple[Any, list[FlyStep]]:
    """The mission of a new booking, and its flights to the last delivery."""
    booking = await composition.book(drone, delivery_id=f"dlv_{drone.drone_id}")
    assert booking.outcome == "BOOKED", booking.reasons
    (instruction,) = await composition.sent(drone.drone_id)
    (mission,) = booking.missions
    flights = [each for each in instruction.steps if isinstance(each, FlyStep)]
    # The drone accepts the steps, also if it uses a little more energy than its model says.
    assert not shortfall_of(
        instruction.steps, model=drone.model, soc=drone.soc, packages=(), energy_use=lambda _: 1.04
    )
    return mission, flights[: sum(step.kind == "FLY" for step in mission.plan.steps)]


async def test_a_mission_shows_what_its_margin_is_made_of(composition: Any, make: Any) -> None:
    await composition.publish(make.network(reserve_risk=0.05))
    risk = EnergyRisk(0.05)

    calm, calm_flights = await booked(composition, make.candidate(1))
    await forecast(composition)
    windy, windy_flights = await booked(composition, make.candidate(2))

    model = make.candidate().model
    slowest_mps = min(model.speed_empty_mps, model.speed_full_mps)
    assert calm.margins.energy_margin == risk.climate_margin(model)
    made_of = calm.margins.risk
    assert made_of.reserve_risk == 0.05
    assert made_of.deviations == pytest.approx(1.645, abs=1e-3)
    assert (made_of.use_deviation, made_of.model_deviation) == (0.08, MODEL_DEVIATION)
    # Without a forecast: 3 m/s in each direction.
    climate = math.log(slowest_mps / (slowest_mps - 3.0 * risk.deviations)) / risk.deviations
    assert made_of.wind_deviation == pytest.approx(climate, abs=1e-4)
    assert made_of.flight_margin <= calm.margins.energy_margin <= made_of.flight_margin + 0.01
    assert {each.energy_factor for each in calm_flights} == {1.0}

    assert windy.margins.energy_margin == risk.own_margin
    made_of = windy.margins.risk
    ground_mps = slowest_mps - 2.0
    against = math.log(ground_mps / (ground_mps - risk.deviations)) / risk.deviations
    assert made_of.wind_deviation == pytest.approx(against, abs=1e-4)
    together = math.sqrt(against**2 + 0.08**2 + MODEL_DEVIATION**2)
    assert made_of.flight_margin == pytest.approx(math.expm1(1.645 * together), abs=1e-3)
    assert (made_of.from_id, made_of.limited_by) == (windy_flights[0].from_id, None)
    out = windy_flights[0]
    assert out.energy_factor * (1 + risk.own_margin) == pytest.approx(
        1 + made_of.flight_margin, abs=0.015
    )
    (first, *_) = (step for step in windy.plan.steps if step.kind == "FLY")
    still_j = flight_energy_j(model, length_m=out.length_m, load_kg=first.load_kg)
    factor = out.time_factor * out.energy_factor * (1 + risk.own_margin)
    landing_j = model.stop_j if out.lands else 0.0
    assert first.energy_j == pytest.approx(still_j * factor + landing_j, rel=1e-6)
    assert await composition.broken() == []


async def test_a_drone_whose_energy_use_varies_more_has_a_larger_margin(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(reserve_risk=0.02))
    await forecast(composition, error_mps=None)
    drones = [
        make.candidate(number, provider_id=f"prv_{number}", learned=learned)
        for number, learned in enumerate(({"still_air_deviation": 0.02}, {}), 1)
    ]

    answer = await composition.parts.quotes.answer(
        QuoteQuery(request=make.request("c"), shortlist=Shortlist.of(drones))
    )
    offers = {each.provider_id: each for each in answer.offers}
    (steady, _), (varied, _) = [await booked(composition, each) for each in drones]

    assert steady.margins.risk.use_deviation == 0.02
    # The forecast states no error, so both have a usual one.
    assert steady.margins.risk.wind_deviation == varied.margins.risk.wind_deviation > 0.05
    assert steady.margins.energy_margin < varied.margins.energy_margin
    assert steady.margins.risk.flight_margin < varied.margins.risk.flight_margin
    assert offers["prv_1"].energy_j < offers["prv_2"].energy_j
    for mission, provider in ((steady, "prv_1"), (varied, "prv_2")):
        assert offers[provider].margins == mission.margins


async def test_without_a_risk_plans_have_the_constant_margin_for_each_drone(
    composition: Any, make: Any
) -> None:
    await forecast(composition)
    before, _ = await booked(composition, make.candidate(1))

    await composition.publish(make.network(reserve_risk=None))
    varied = {"still_air_deviation": 0.2}
    after, _ = await booked(composition, make.candidate(2, learned=varied))
    _, asked = await offers_of(
        composition, make.request("b"), make.candidate(3), make.candidate(4, learned=varied)
    )

    # Drones whose energy use varies differently share a plan, as before.
    assert asked == ["a"]

    steps = [
        [each.model_dump(exclude={"pad"}) for each in mission.plan.steps]
        for mission in (before, after)
    ]
    assert steps[0] == steps[1]
    assert "risk" not in after.model_dump(mode="json")["margins"]
    assert after.margins == before.margins


async def test_a_flight_that_needs_more_than_the_largest_margin_says_so(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(reserve_risk=0.000001))
    await forecast(composition, error_mps=5.0)

    mission, _ = await booked(composition, make.candidate(1))

    assert (mission.margins.risk.flight_margin, mission.margins.risk.limited_by) == (0.4, "MOST")


@pytest.mark.parametrize("has_forecast", [False, True])
async def test_with_a_risk_no_offer_is_below_its_lower_bounds(
    composition: Any, make: Any, has_forecast: bool
) -> None:
    await composition.publish(make.network(reserve_risk=0.05))
    if has_forecast:
        await forecast(composition)
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.parts.db, after_ms=0)
    for number, learned in enumerate(({}, {"still_air_deviation": 0.02})):
        candidate = make.candidate(number, learned=learned)
        shortlist = Shortlist.of([candidate])
        for request in (make.request("b"), make.request("c", "e")):
            offers, _ = await offers_of(composition, request, candidate)

            least = LowerBounds.of(
                skyway,
                request,
                shortlist,
                waits_s=np.zeros(1),
                time_factors=world.least_time_factors(shortlist.model_of),
                energy_margins=world.energy_margins(shortlist),
            )
            values = offers.ranked[0].values
            assert least.time_s[0] <= values.time_s + 1e-6
            assert least.price[0] <= values.price
            assert least.energy_j[0] <= values.energy_j * (1 + 1e-9)


@pytest.mark.parametrize("risk", [0.0, 0.21, -0.1, "often"])
async def test_an_impossible_risk_is_refused_with_its_name(
    composition: Any, make: Any, risk: Any
) -> None:
    answer = await composition(OPERATOR, "PUT", "/v1/networks/row", make.network(reserve_risk=risk))

    assert answer.status_code == 422
    assert "reserve_risk" in answer.text


async def test_a_plan_says_how_late_the_error_of_its_forecast_may_make_it(
    composition: Any, make: Any
) -> None:
    calm, _ = await booked(composition, make.candidate(1))
    await forecast(composition, error_mps=1.0)
    sure, _ = await booked(composition, make.candidate(2))
    await forecast(composition, error_mps=3.0)
    unsure, _ = await booked(composition, make.candidate(3))

    assert calm.margins.late_share is None
    model = make.candidate().model
    slowest_mps = min(model.speed_empty_mps, model.speed_full_mps)
    wrong_mps = 1.2816 * 1.0
    against = (slowest_mps - 2.0) / (slowest_mps - 2.0 - wrong_mps) - 1
    assert 0.5 * against < sure.margins.late_share <= against + 1e-3
    assert unsure.margins.late_share > 2 * sure.margins.late_share


async def test_after_its_end_a_forecast_closes_nothing_and_is_not_computed(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(reserve_risk=0.05))
    await forecast(composition)
    skyway = await composition.parts.networks.current("row")
    now_ms = moment_to_ms(composition.clock.now())
    world = await World.of(skyway, composition.parts.db, after_ms=now_ms)
    model = make.candidate().model

    in_force = ClosedAhead.of(world, now_ms=now_ms)
    over = ClosedAhead.of(world, now_ms=now_ms + 40 * 3_600_000)

    assert in_force.for_model(model) is not in_force
    assert over.for_model(model) is over


async def weather_at_risk(composition: Any, make: Any) -> NetworkWeather:
    """The weather of a network with a forecast and a `reserve_risk`."""
    await composition.publish(make.network(reserve_risk=0.05))
    await forecast(composition)
    skyway = await composition.parts.networks.current("row")
    now_ms = moment_to_ms(composition.clock.now())
    weather = (await World.of(skyway, composition.parts.db, after_ms=now_ms)).conditions.weather
    assert weather is not None
    return weather


async def test_a_small_cache_of_weather_holds_few_deviations_and_those_used_last(
    composition: Any, make: Any
) -> None:
    roomy = await weather_at_risk(composition, make)
    model = make.candidate().model
    size = roomy.of_model(model).time_factor.size
    small = replace(roomy, most_cached=2 * size, _of_model={})

    used = [0.02, 0.06, 0.08, 0.1, 0.26]
    assert [roomy.planned_deviation(each) for each in used] == used
    assert [small.planned_deviation(each) for each in used] == [0.04, 0.08, 0.08, 0.14, 0.26]

    first, second = small.of_model(model, 0.04), small.of_model(model, 0.08)
    assert small.of_model(model, 0.04) is first
    small.of_model(model, 0.14)
    assert small.of_model(model, 0.04) is first
    assert small.of_model(model, 0.08) is not second


async def test_the_loop_computes_no_weather_that_another_plan_has_pushed_out(
    composition: Any, make: Any
) -> None:
    roomy = await weather_at_risk(composition, make)
    model = make.candidate().model
    size = roomy.of_model(model).time_factor.size
    asked_in: list[int] = []

    class Watched(NetworkWeather):
        def of_model(self, model: DroneModel, use_deviation: float = UNKNOWN_USE) -> Weather:
            asked_in.append(get_ident())
            return super().of_model(model, use_deviation)

    tight = Watched(roomy.stored, roomy.network, roomy.forecast, 0.05, most_cached=size)
    now_ms = moment_to_ms(composition.clock.now())
    await asyncio.gather(
        *(tight.of_plan(model, now_ms, use_deviation=each) for each in (0.04, 0.08, 0.14))
    )

    assert len(asked_in) == 3
    assert get_ident() not in asked_in
