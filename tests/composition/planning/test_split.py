"""Requests that no drone can fly undivided, and several can; and what else is possible."""

from itertools import permutations, product
from random import Random
from typing import Any

import pytest
from skyway_composition.planning.availability import Availability
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer, Offers, Part
from skyway_composition.planning.plan_offers import best_of_each
from skyway_composition.planning.split import MOST_TRIPS
from skyway_composition.planning.world import World

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import rank_offers
from skyway.delivery.request import DeliveryRequest
from skyway.planner.problem import Problem
from skyway.scheduling.trip import Trip
from skyway.units import moment_to_ms
from tests.long_cases import sampled

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

FASTEST = {"objective": "FASTEST"}


async def publish(
    composition: Any, make: Any, *, pads: dict[str, int], km: float = 10.0, **settings: Any
) -> None:
    """A row of stations that lie so far apart."""
    network = make.network(pads=pads, **settings)
    for feature in network["features"]:
        if feature["properties"]["kind"] == "segment":
            feature["properties"]["length_m"] = km * 1000
    await composition.publish(network)


async def finder_of(composition: Any, request: DeliveryRequest) -> TripFinder:
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.db, after_ms=0)
    start_ms = moment_to_ms(composition.clock.now())
    latest_ms = Limits.of(request.qos).latest_ms
    return TripFinder(composition.parts.solver, world, start_ms, latest_ms)


async def quoted(composition: Any, request: DeliveryRequest, *drones: Any) -> Offers:
    """The offers of a quote for these drones without missions."""
    finder = await finder_of(composition, request)
    return await best_of_each(
        finder,
        request,
        shortlist=Shortlist.of(drones),
        available=Availability.of([], begins_ms=finder.start_ms, clock=composition.clock),
        gaps=[],
        limits=Limits.of_whole(request.qos),
    )


def drones_at(make: Any, station_id: str, count: int, **members: Any) -> list[Any]:
    places = {"station_id": station_id, "home_station_id": station_id, **members}
    return [make.candidate(number, **places) for number in range(1, count + 1)]


#: Only both ends of the row have pads, so no drone flies from the middle to both sides.
_ENDS = {"b": 0, "c": 0, "d": 0}


async def test_an_order_that_range_forbids_is_split_over_two_drones(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads=_ENDS)
    request = make.request("b", "d", pickup="c")

    offers = await quoted(composition, request, *drones_at(make, "c", 2))

    (offer,) = offers.ranked
    carried = sorted([each.package_id for each in part.request.packages] for part in offer.parts)
    assert carried == [["p1"], ["p2"]]


async def test_one_drone_for_two_far_packages_is_a_reason_that_passes(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads=_ENDS)
    request = make.request("b", "d", pickup="c")

    offers = await quoted(composition, request, *drones_at(make, "c", 1))

    (reason,) = offers.reasons
    assert (reason.code, reason.is_temporary) == ("NOT_ENOUGH_DRONES", True)
    assert [each.kind for each in reason.possible] == ["APART"]


async def test_a_booking_without_price_limit_flies_one_package_and_leaves_the_other_for_later(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads=_ENDS)
    request = make.request("b", "d", pickup="c")

    booking = await composition.book(*drones_at(make, "c", 1), request=request)

    assert booking.outcome == "BOOKED"
    assert [len(mission.packages) for mission in booking.missions] == [1]


async def test_an_order_with_a_package_that_nobody_can_fly_is_rejected_as_a_whole(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads={**_ENDS, "e": 0})
    request = make.request("b", "e", pickup="c")

    booking = await composition.book(*drones_at(make, "c", 2), request=request)

    assert booking.outcome == "INFEASIBLE"
    (reason,) = booking.reasons
    assert (reason.code, reason.is_temporary) == ("OUT_OF_RANGE", False)
    assert [(each.kind, each.package_ids) for each in reason.possible] == [("WITHOUT", ("p2",))]
    assert reason.detail.endswith("possible: each other package alone, without 'p2'")


async def test_a_load_too_heavy_for_the_way_is_answered_with_how_much_less_flies(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads=_ENDS, km=11.0)
    request = make.request("b", pickup="c", mass_kg=9.0)

    offers = await quoted(composition, request, *drones_at(make, "c", 1))

    (reason,) = offers.reasons
    (less,) = reason.possible
    assert less.kind == "LESS"
    assert less.less_kg is not None
    lighter = make.request("b", pickup="c", mass_kg=9.0 - less.less_kg)
    assert (await quoted(composition, lighter, *drones_at(make, "c", 1))).ranked


async def test_a_deadline_that_is_too_early_is_answered_with_the_possible_moment(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads=_ENDS)
    soon = composition.clock.now().isoformat()
    request = make.request("b", pickup="c", qos={"deadline_at": soon})

    offers = await quoted(composition, request, *drones_at(make, "c", 1))

    (reason,) = offers.reasons
    (later,) = reason.possible
    assert (reason.code, later.kind) == ("TOO_LATE", "LATER")
    assert later.at is not None
    patient = make.request("b", pickup="c", qos={"deadline_at": later.at.isoformat()})
    assert (await quoted(composition, patient, *drones_at(make, "c", 1))).ranked


@pytest.mark.parametrize(
    ("objective", "trips"), [("FASTEST", 3), ("CHEAPEST", 2)], ids=["fastest", "cheapest"]
)
async def test_the_division_is_the_best_by_the_objective_of_the_customer(
    composition: Any, make: Any, objective: str, trips: int
) -> None:
    await publish(composition, make, pads=_ENDS)
    request = make.request("b", "a", "d", pickup="c", qos={"objective": objective})

    offers = await quoted(composition, request, *drones_at(make, "c", 3))

    assert len(offers.ranked[0].parts) == trips


@pytest.mark.parametrize("seed", sampled(range(12), every=3))
async def test_an_order_has_an_offer_if_and_only_if_some_division_of_it_has_a_plan(
    composition: Any, make: Any, seed: int
) -> None:
    rng = Random(seed)
    pads = {name: rng.choice([0, 0, 1]) for name in "abcde"}
    await publish(composition, make, pads=pads, km=rng.choice([8.0, 10.0, 12.0]))
    request = make.request(
        *rng.sample("abde", rng.choice([2, 3])),
        pickup="c",
        mass_kg=rng.choice([0.4, 6.0]),
        qos={"objective": rng.choice(["FASTEST", "CHEAPEST"])},
    )
    drones = [
        make.candidate(
            number, station_id="c", home_station_id="c", soc=rng.choice([0.4, 0.7, 0.9, 1.0])
        )
        for number in (1, 2)
    ]

    offers = await quoted(composition, request, *drones)

    possible = await _divisions(composition, request, drones)
    assert bool(offers.ranked) == bool(possible)
    if possible and len(offers.ranked[0].parts) > 1:
        ranked = rank_offers([each.values for each in possible], request.qos.ranking)
        best = possible[ranked[0]].values
        assert offers.ranked[0].values.time_s == pytest.approx(best.time_s)
        assert offers.ranked[0].values.price == best.price


async def _divisions(composition: Any, request: DeliveryRequest, drones: list[Any]) -> list[Offer]:
    """All divisions of the packages among these drones that have plans, in every order of drones.

    A drone without packages does not fly.
    """
    finder = await finder_of(composition, request)
    network = finder.world.skyway.network
    found = []
    for order in permutations(drones):
        for places in product(range(len(drones)), repeat=len(request.packages)):
            parts: list[Part] = []
            for place, drone in enumerate(order):
                load = tuple(
                    package
                    for package, own in zip(request.packages, places, strict=True)
                    if own == place
                )
                if not load:
                    continue
                own = request.model_copy(update={"packages": load})
                held = sorted(pad for part in parts for pad in part.trip.booked_pads)
                trip = await finder.trip(drone, own, held=held)
                if not isinstance(trip, Trip):
                    break
                parts.append(Part.of(drone, trip, request=own, network=network, opening=None))
            else:
                found.append(Offer(tuple(parts), finder.start_ms))
    return found


async def test_a_large_order_plans_no_more_trips_than_the_limit(
    composition: Any, make: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    await publish(composition, make, pads={**_ENDS, "e": 0})
    request = make.request(*"bebebebebebe", pickup="c")
    solver, asked = composition.parts.solver, []
    compose = type(solver).compose

    async def counted(self: Any, problem: Problem, **options: Any) -> Any:
        if problem.finish == "recharge":
            asked.append(problem)
        return await compose(self, problem, **options)

    monkeypatch.setattr(type(solver), "compose", counted)
    drones = [
        make.candidate(number, station_id="c", home_station_id="c", soc=1.0 - number / 100)
        for number in range(5)
    ]

    offers = await quoted(composition, request, *drones)

    assert not offers.ranked
    assert len(asked) <= MOST_TRIPS + 2 * len(drones)


_BOX = {"length": 300, "width": 200, "height": 200}


def with_cargo(make: Any, station_id: str, count: int, **abilities: Any) -> list[Any]:
    drones = drones_at(make, station_id, count)
    document = drones[0].model.model_dump() | abilities
    model = type(drones[0].model).model_validate(document)
    return [each.model_copy(update={"model": model}) for each in drones]


def with_needs(request: DeliveryRequest, *needs: dict[str, Any]) -> DeliveryRequest:
    document = request.model_dump(mode="json")
    packages = zip(document["packages"], needs, strict=True)
    document["packages"] = [{**package, **more} for package, more in packages]
    return DeliveryRequest.model_validate(document)


async def test_packages_that_do_not_fit_together_fly_with_two_drones(
    composition: Any, make: Any
) -> None:
    await publish(composition, make, pads={}, km=2.0)
    needs = {"size_mm": _BOX}
    request = with_needs(make.request("b", "d", pickup="c"), needs, needs)

    offers = await quoted(composition, request, *with_cargo(make, "c", 2, cargo_mm=_BOX))

    assert [len(offer.parts) for offer in offers.ranked] == [2]


@pytest.mark.parametrize(
    ("needs", "code"),
    [({"size_mm": {**_BOX, "length": 301}}, "TOO_LARGE"), ({"handling": ["COLD"]}, "HANDLING")],
)
@pytest.mark.parametrize("packages", [1, 2])
async def test_a_package_that_no_drone_may_carry_has_a_named_reason(
    composition: Any, make: Any, needs: dict[str, Any], code: str, packages: int
) -> None:
    await publish(composition, make, pads={}, km=2.0)
    ends = ("b", "d")[:packages]
    request = with_needs(make.request(*ends, pickup="c"), *[needs, {}][:packages])

    offers = await quoted(composition, request, *with_cargo(make, "c", 2, cargo_mm=_BOX))

    assert offers.ranked == ()
    assert [each.code for each in offers.reasons] == [code]
