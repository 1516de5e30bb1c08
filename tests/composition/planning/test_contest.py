"""Pruning: a candidate that is not composed would neither win nor change the winner."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from skyway_composition.planning.contest import Contest
from skyway_composition.planning.lower_bounds import LowerBounds

from skyway.contracts.candidate import Candidate, Standby
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import OfferValues, Tariff, rank_offers
from skyway.delivery.qos import Weights
from skyway.drone.models import PAPER_SCENARIO
from skyway.ids import DroneId, ProviderId, StationId

_AMOUNTS = st.integers(0, 6)


@st.composite
def entrants(draw: st.DrawFn) -> list[tuple[OfferValues, OfferValues | None]]:
    """Each candidate's lower bounds and its true values; None for no trip."""
    count = draw(st.integers(1, 7))
    no_shows = draw(st.lists(st.integers(0, 8), min_size=3, max_size=3))
    found = []
    for number in range(count):
        provider = draw(st.integers(0, 2))
        least = OfferValues(
            time_s=float(draw(_AMOUNTS)),
            price=draw(_AMOUNTS),
            energy_j=float(draw(_AMOUNTS)),
            provider_id=ProviderId(f"prv_{provider}"),
            drone_id=DroneId(f"drn_{number}"),
            no_shows=no_shows[provider],
        )
        true = replace(
            least,
            time_s=least.time_s + draw(_AMOUNTS),
            price=least.price + draw(_AMOUNTS),
            energy_j=least.energy_j + draw(_AMOUNTS),
        )
        found.append((least, true if draw(st.integers(0, 5)) else None))
    return found


def weights() -> st.SearchStrategy[Weights]:
    some = st.sampled_from([0.0, 0.3, 1.0])
    return (
        st.builds(dict, time=some, price=some, energy=some)
        .filter(lambda each: any(each.values()))
        .map(Weights.model_validate)
    )


def make_candidate(values: OfferValues, *, station_id: str, standby: Standby = "HOME") -> Candidate:
    return Candidate(
        provider_id=values.provider_id,
        drone_id=values.drone_id,
        model=PAPER_SCENARIO,
        soc=1.0,
        station_id=StationId(station_id),
        home_station_id=StationId("a"),
        tariff=Tariff(),
        standby=standby,
        no_shows=values.no_shows,
    )


def winner(offers: list[OfferValues], by: Weights) -> OfferValues | None:
    ranked = rank_offers(offers, by)
    return offers[ranked[0]] if ranked else None


def contested(
    among: Sequence[tuple[OfferValues, OfferValues | None]], by: Weights
) -> tuple[list[OfferValues], int]:
    """The offers of the composed candidates, and the number of compositions."""
    # Each candidate has its own station, so that no two share a plan.
    shortlist = Shortlist.of(
        make_candidate(least, station_id=f"s{number}") for number, (least, _) in enumerate(among)
    )
    columns = zip(*((each.time_s, each.price, each.energy_j) for each, _ in among), strict=True)
    contest = Contest(
        shortlist, LowerBounds(*(np.array(each, np.float64) for each in columns)), by, openings={}
    )
    found: list[OfferValues] = []
    composed = 0
    while rows := contest.next_to_compose(found):
        composed += len(rows)
        found += [values for row in rows if (values := among[row][1]) is not None]
    return found, composed


@given(entrants(), weights())
def test_pruning_never_changes_the_winner(
    among: list[tuple[OfferValues, OfferValues | None]], by: Weights
) -> None:
    everything = [true for _, true in among if true is not None]

    found, _ = contested(among, by)

    assert winner(found, by) == winner(everything, by)


def test_a_candidate_that_is_better_in_nothing_is_not_composed() -> None:
    best = OfferValues(10.0, 100, 5.0, ProviderId("prv_1"), DroneId("drn_1"))
    others = [
        replace(best, time_s=11.0 + number, drone_id=DroneId(f"drn_{number}"))
        for number in range(2, 9)
    ]

    _, composed = contested(
        [(each, each) for each in (best, *others)], Weights(time=1, price=1, energy=1)
    )

    assert composed == 1


def test_a_candidate_that_changes_the_best_values_is_composed() -> None:
    fast = OfferValues(10.0, 1000, 5.0, ProviderId("prv_1"), DroneId("drn_1"))
    even = OfferValues(20.0, 900, 5.0, ProviderId("prv_2"), DroneId("drn_2"))
    slow = OfferValues(90.0, 300, 5.0, ProviderId("prv_3"), DroneId("drn_3"))

    found, _ = contested([(each, each) for each in (fast, even, slow)], Weights(time=1, price=1))

    assert slow in found


def test_a_candidate_is_composed_even_when_no_candidate_has_a_way() -> None:
    lost = OfferValues(math.inf, 0, math.inf, ProviderId("prv_1"), DroneId("drn_1"))
    others = [replace(lost, drone_id=DroneId(f"drn_{number}")) for number in (2, 3)]

    found, composed = contested(
        [(each, None) for each in (lost, *others)], Weights(time=1, price=1, energy=1)
    )

    assert (found, composed) == ([], 3)


def test_only_drones_with_the_same_standby_share_a_plan() -> None:
    drones = [
        OfferValues(10.0, 100, 5.0, ProviderId("prv_1"), DroneId(f"drn_{number}"))
        for number in range(3)
    ]
    standbys: list[Standby] = ["STAY", "PARKING", "STAY"]
    shortlist = Shortlist.of(
        make_candidate(values, station_id="a", standby=standby)
        for values, standby in zip(drones, standbys, strict=True)
    )
    equal = LowerBounds(np.full(3, 10.0), np.full(3, 100.0), np.full(3, 5.0))
    contest = Contest(shortlist, equal, Weights(time=1), openings={})

    assert contest.next_to_compose([]) == [0, 2]


def test_drones_of_two_providers_that_go_near_the_next_pickup_share_no_plan() -> None:
    drones = [
        OfferValues(10.0, 100, 5.0, ProviderId(f"prv_{number % 2}"), DroneId(f"drn_{number}"))
        for number in range(4)
    ]
    shortlist = Shortlist.of(
        make_candidate(values, station_id="a", standby="NEXT_PICKUP") for values in drones
    )
    equal = LowerBounds(np.full(4, 10.0), np.full(4, 100.0), np.full(4, 5.0))
    contest = Contest(shortlist, equal, Weights(time=1), openings={})

    assert contest.next_to_compose([]) == [0, 2]


@given(entrants(), weights())
def test_the_winner_by_lower_bounds_is_composed_first(
    among: list[tuple[OfferValues, OfferValues | None]], by: Weights
) -> None:
    bounds = [(least, least) for least, _ in among]

    found, _ = contested(bounds, by)

    assert found[0] == winner([least for least, _ in among], by)
