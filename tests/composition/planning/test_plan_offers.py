"""Offers: composed as seldom as possible, ranked as the customer asks."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.lower_bounds import LowerBounds
from skyway_composition.planning.offer import Limits, terms_of
from skyway_composition.planning.plan_offers import plan_offers
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import BestValues, price_of
from skyway.delivery.plan import Plan
from skyway.delivery.qos import Weights
from skyway.ids import DroneId, StationId
from skyway.planner.problem import Problem
from skyway.units import moment_to_ms
from tests.long_cases import sampled

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


WORN = {"still_air_factor": 1.05, "state_of_health": 0.95, "charge_rate_factor": 0.8}


class CountingSolver(SolverPool):
    """Remembers the problems that it composed, without the ways home."""

    def __init__(self) -> None:
        super().__init__(threads=1, time_limit_s=5.0)
        self.asked: list[StationId] = []

    async def compose(self, problem: Problem, **options: Any) -> Plan:
        if problem.finish == "recharge":
            self.asked.append(problem.start_station_id)
        return await super().compose(problem, **options)


async def offers_of(
    composition: Any,
    request: Any,
    *candidates: Any,
    busy: Mapping[DroneId, int | None] | None = None,
) -> Any:
    """The offers, and the start stations of all compositions."""
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.parts.db, after_ms=0)
    start_ms = moment_to_ms(composition.clock.now())
    limits = Limits.of(request.qos)
    async with CountingSolver() as solver:
        offers = await plan_offers(
            TripFinder(solver, world, start_ms, limits.latest_ms),
            request,
            shortlist=Shortlist.of(candidates),
            busy=busy or {},
            limits=limits,
        )
    return offers, solver.asked


async def test_equal_drones_are_composed_once(composition: Any, make: Any) -> None:
    drones = [make.candidate(number) for number in range(5)]

    offers, asked = await offers_of(composition, make.request("b"), *drones)

    assert (len(offers.ranked), asked) == (5, ["a"])


async def test_drones_that_fly_alike_share_a_plan_and_a_worn_drone_gets_its_own(
    composition: Any, make: Any
) -> None:
    worn = [make.candidate(number, learned=WORN) for number in (2, 3)]
    request = make.request("b", qos={"weights": {"time": 1, "energy": 1}})

    alike, asked = await offers_of(composition, request, *worn)
    best, _ = await offers_of(composition, request, *worn, make.candidate(1))

    assert (len(alike.ranked), asked) == (2, ["a"])
    (new, *_) = best.ranked
    assert new.values.drone_id == "drn_1"
    assert alike.ranked[0].values.energy_j == pytest.approx(1.05 * new.values.energy_j)


async def test_a_drone_too_far_to_win_is_not_composed_when_only_time_counts(
    composition: Any, make: Any
) -> None:
    near, far = make.candidate(1), make.candidate(2, station_id="e")

    offers, asked = await offers_of(composition, make.request("b"), far, near)

    assert [offer.values.drone_id for offer in offers.ranked] == ["drn_1"]
    assert asked == ["a"]


async def test_a_drone_that_may_be_cheaper_is_composed_when_the_price_counts(
    composition: Any, make: Any
) -> None:
    near = make.candidate(1)
    cheap = make.candidate(2, station_id="b", provider_id="prv_2", tariff={"base": 1})
    dear = make.candidate(3, station_id="e", provider_id="prv_3", tariff={"base": 5_000})
    request = make.request("b", qos={"weights": {"time": 1, "price": 1}})

    _, asked = await offers_of(composition, request, dear, cheap, near)

    assert sorted(asked) == ["a", "b"]


@pytest.mark.parametrize(
    ("soc", "learned"), [(1.0, {}), (0.4, {}), (0.4, {"still_air_factor": 0.8}), (0.8, WORN)]
)
@pytest.mark.parametrize("station_id", sampled("abcde", every=3))
async def test_no_offer_is_below_its_lower_bounds(
    composition: Any, make: Any, station_id: str, soc: float, learned: dict[str, float]
) -> None:
    skyway = await composition.parts.networks.current("row")
    candidate = make.candidate(station_id=station_id, soc=soc, learned=learned)
    for request in (make.request("b"), make.request("c", "e"), make.request("e", "a", "c")):
        offers, _ = await offers_of(composition, request, candidate)

        least = LowerBounds.of(skyway, request, Shortlist.of([candidate]), waits_s=np.zeros(1))
        values = offers.ranked[0].values
        assert least.time_s[0] <= values.time_s + 1e-6
        assert least.price[0] <= values.price
        assert least.energy_j[0] <= values.energy_j * (1 + 1e-9)


async def test_the_lowest_price_is_the_tariff_for_the_shortest_way(
    composition: Any, make: Any
) -> None:
    skyway = await composition.parts.networks.current("row")
    tariffs = [
        {"per_km": 1_000_000},
        {"per_recharge_minute": 600_000},
        {"base": 1, "per_km": 100, "per_kg": 37, "per_recharge_minute": 3},
        {"base": 5, "per_km": 33, "minimum": 90_000},
    ]
    candidates = [
        make.candidate(number, provider_id=f"prv_{number}", tariff=tariff)
        for number, tariff in enumerate(tariffs)
    ]
    request = make.request("e")

    least = LowerBounds.of(
        skyway, request, Shortlist.of(candidates), waits_s=np.zeros(len(candidates))
    )

    length, charging, *others = least.price.tolist()
    assert length > 0 < charging
    assert others == [
        price_of(
            each.tariff,
            distance_m=length / 1_000,
            payload_kg=request.payload_kg,
            recharging_s=charging / 10_000,
        ).amount
        for each in candidates[2:]
    ]


@pytest.mark.parametrize(
    ("qos", "amount"),
    [
        ({"pooling": True}, 300),
        ({}, None),
        ({"pooling": True, "deadline_at": "2026-03-02T12:00:00Z"}, None),
    ],
    ids=["pooling", "no pooling", "a deadline"],
)
async def test_an_offer_names_the_pooled_price_if_its_trip_may_be_shared(
    composition: Any, make: Any, qos: dict[str, Any], amount: int | None
) -> None:
    drone = make.candidate(1, tariff={"base": 500, "pooled_factor": 0.6})

    offers, _ = await offers_of(composition, make.request("e", qos=qos), drone)

    offer, best = offers.ranked[0], BestValues.of([offers.ranked[0].values])
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.parts.db, after_ms=0)
    terms = terms_of(offer, best=best, weights=Weights(time=1), world=world)
    assert terms.price.amount == 500
    assert (terms.pooled_price and terms.pooled_price.amount) == amount


async def test_priority_multiplies_the_lowest_price_and_the_price(
    composition: Any, make: Any
) -> None:
    skyway = await composition.parts.networks.current("row")
    tariff = {"base": 501, "per_km": 20, "priority_factor": 2}
    drone = make.candidate(1, tariff=tariff)
    least, prices = [], []
    for priority in ("STANDARD", "PRIORITY"):
        request = make.request("e", qos={"priority": priority})
        offers, _ = await offers_of(composition, request, drone)
        least.append(
            LowerBounds.of(skyway, request, Shortlist.of([drone]), waits_s=np.zeros(1)).price[0]
        )
        prices.append(offers.ranked[0].price.amount)

    assert least[1] == 2 * least[0]
    assert prices[1] == 2 * prices[0]


async def test_a_segment_shorter_than_the_great_circle_lowers_the_time_bound(
    composition: Any, make: Any
) -> None:
    network = make.network()
    straight = await composition.parts.networks.current("row")
    network["features"][-1]["properties"]["length_m"] = 10_000
    await composition.publish(network)

    short = await composition.parts.networks.current("row")

    assert straight.straightness == pytest.approx(1.0, abs=1e-6)
    assert short.straightness == pytest.approx(0.5, abs=1e-3)


async def test_a_provider_with_an_offer_gives_no_reason(composition: Any, make: Any) -> None:
    busy = make.candidate(1)
    free = make.candidate(2)
    other = make.candidate(3, provider_id="prv_2")

    on_missions = dict.fromkeys((DroneId("drn_1"), DroneId("drn_3")))
    offers, _ = await offers_of(composition, make.request("b"), busy, free, other, busy=on_missions)

    assert [(each.provider_id, each.code) for each in offers.reasons] == [("prv_2", "BUSY")]


async def test_of_two_busy_drones_the_one_that_is_free_first_is_named(
    composition: Any, make: Any
) -> None:
    drones = [make.candidate(number) for number in (1, 2, 3)]
    noon_ms = moment_to_ms(composition.clock.now())
    free = zip(drones, (None, noon_ms + 7_200_000, noon_ms + 3_600_000), strict=True)
    busy = {drone.drone_id: free_ms for drone, free_ms in free}

    offers, _ = await offers_of(composition, make.request("b"), *drones, busy=busy)

    (reason,) = offers.reasons
    assert (reason.code, reason.data) == ("BUSY", {"free_at": "2026-03-01T13:00:00Z"})
