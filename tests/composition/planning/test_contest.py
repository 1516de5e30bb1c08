"""Pruning: who is not composed would not have won, nor changed who wins."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from skyway_composition.planning.contest import Contest
from skyway_composition.planning.lower_bounds import Least

from skyway.contracts.candidate import Candidate
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import OfferValues, Tariff, rank_offers
from skyway.delivery.request import Weights
from skyway.drone.models import PAPER_SCENARIO
from skyway.ids import DroneId, ProviderId, StationId

_AMOUNTS = st.integers(0, 6)


@st.composite
def entrants(draw: st.DrawFn) -> list[tuple[OfferValues, OfferValues | None]]:
    """The least values of each candidate and its true ones; None: it has no trip."""
    count = draw(st.integers(1, 7))
    found = []
    for number in range(count):
        least = OfferValues(
            time_s=float(draw(_AMOUNTS)),
            price=draw(_AMOUNTS),
            energy_j=float(draw(_AMOUNTS)),
            provider_id=ProviderId(f"prv_{draw(st.integers(0, 2))}"),
            drone_id=DroneId(f"drn_{number}"),
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


def make_candidate(values: OfferValues, *, station_id: str) -> Candidate:
    return Candidate(
        provider_id=values.provider_id,
        drone_id=values.drone_id,
        model=PAPER_SCENARIO,
        soc=1.0,
        station_id=StationId(station_id),
        home_station_id=StationId("a"),
        tariff=Tariff(),
    )


def winner(offers: list[OfferValues], by: Weights) -> OfferValues | None:
    ranked = rank_offers(offers, by)
    return offers[ranked[0]] if ranked else None


def contested(
    among: Sequence[tuple[OfferValues, OfferValues | None]], by: Weights
) -> tuple[list[OfferValues], int]:
    """The offers of those who were composed, and how many those were."""
    # Each at a place of its own, so that nobody is another's twin.
    shortlist = Shortlist.of(
        make_candidate(least, station_id=f"s{number}") for number, (least, _) in enumerate(among)
    )
    columns = zip(*((each.time_s, each.price, each.energy_j) for each, _ in among), strict=True)
    contest = Contest(shortlist, Least(*(np.array(each, np.float64) for each in columns)), by)
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


def test_who_is_no_better_in_anything_is_not_composed() -> None:
    best = OfferValues(10.0, 100, 5.0, ProviderId("prv_1"), DroneId("drn_1"))
    others = [
        replace(best, time_s=11.0 + number, drone_id=DroneId(f"drn_{number}"))
        for number in range(2, 9)
    ]

    _, composed = contested(
        [(each, each) for each in (best, *others)], Weights(time=1, price=1, energy=1)
    )

    assert composed == 1


def test_who_cannot_win_but_changes_the_scale_is_composed() -> None:
    fast = OfferValues(10.0, 1000, 5.0, ProviderId("prv_1"), DroneId("drn_1"))
    even = OfferValues(20.0, 900, 5.0, ProviderId("prv_2"), DroneId("drn_2"))
    slow = OfferValues(90.0, 300, 5.0, ProviderId("prv_3"), DroneId("drn_3"))

    found, _ = contested([(each, each) for each in (fast, even, slow)], Weights(time=1, price=1))

    assert slow in found


def test_nobody_with_a_way_still_leaves_somebody_to_compose_for() -> None:
    lost = OfferValues(math.inf, 0, math.inf, ProviderId("prv_1"), DroneId("drn_1"))
    others = [replace(lost, drone_id=DroneId(f"drn_{number}")) for number in (2, 3)]

    found, composed = contested(
        [(each, None) for each in (lost, *others)], Weights(time=1, price=1, energy=1)
    )

    assert (found, composed) == ([], 3)


@given(entrants(), weights())
def test_who_is_composed_first_is_who_would_win_by_the_bounds(
    among: list[tuple[OfferValues, OfferValues | None]], by: Weights
) -> None:
    bounds = [(least, least) for least, _ in among]

    found, _ = contested(bounds, by)

    assert found[0] == winner([least for least, _ in among], by)
