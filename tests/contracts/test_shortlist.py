"""Candidates travel as columns, and arrive as they were."""

from typing import Any

import pytest
from pydantic import ValidationError

from skyway.contracts.candidate import Candidate
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Tariff
from skyway.drone.learned_values import LearnedValues
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_SCENARIO
from skyway.ids import ProviderId

WORN = LearnedValues(state_of_health=0.9)


def make_candidate(number: int, **members: Any) -> Candidate:
    values = {
        "provider_id": "prv_1",
        "drone_id": f"drn_{number}",
        "model": PAPER_SCENARIO,
        "soc": 1.0 - number / 100,
        "station_id": f"here-{number}",
        "home_station_id": f"home-{number}",
        "tariff": Tariff(base=100),
        **members,
    }
    return Candidate.model_validate(values)


def sent(shortlist: Shortlist) -> Shortlist:
    return Shortlist.read(shortlist.model_dump_json())


def test_candidates_arrive_as_they_were_and_in_their_order() -> None:
    candidates = (
        make_candidate(3),
        make_candidate(1, provider_id="prv_2", tariff=Tariff(base=5), loading="CONFIRMED"),
        make_candidate(2, model=DJI_MATRICE_300_RTK, standby="STAY"),
        make_candidate(4, learned=WORN),
    )

    arrived = sent(Shortlist.of(candidates))

    assert arrived.candidates == candidates


def test_candidates_of_a_model_share_it_and_those_of_a_provider_its_tariff() -> None:
    arrived = sent(Shortlist.of([make_candidate(1), make_candidate(2)]))

    first, second = arrived.candidates
    assert first.model is second.model
    assert first.tariff is second.tariff


def test_a_model_and_the_terms_of_a_provider_are_sent_once() -> None:
    shortlist = Shortlist.of([make_candidate(number) for number in range(9)])

    assert (len(shortlist.models), len(shortlist.providers)) == (1, 1)


def test_learned_values_are_sent_only_if_a_drone_has_some() -> None:
    as_modelled = Shortlist.of([make_candidate(1), make_candidate(2)])
    mixed = Shortlist.of([make_candidate(1), make_candidate(2, learned=WORN)])

    assert as_modelled.learned == mixed.only([0]).learned == ()
    assert [each.planned_model.battery_j for each in sent(mixed).candidates] == [
        PAPER_SCENARIO.battery_j,
        pytest.approx(0.9 * PAPER_SCENARIO.battery_j),
    ]


def test_a_shortlist_without_drones_is_empty() -> None:
    assert sent(Shortlist()).is_empty
    assert Shortlist().candidates == ()
    assert not Shortlist.of([make_candidate(1)]).is_empty


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("socs", []),
        ("station_ids", ["a", "b"]),
        ("standbys", ["STAY", "HOME"]),
        ("standbys", ["ROAM"]),
        ("learned", [{}, {}]),
        ("learned", [{"state_of_health": 0.1}]),
        ("models", []),
        ("providers", []),
        ("model_ids", ["unheard-of"]),
        ("socs", [1.5]),
    ],
)
def test_a_broken_row_is_refused_where_it_arrives(column: str, value: list[object]) -> None:
    whole = Shortlist.of([make_candidate(1)]).model_dump(mode="json")

    with pytest.raises(ValidationError):
        Shortlist.model_validate({**whole, column: value})


def test_some_rows_are_those_candidates_in_the_order_asked_for() -> None:
    candidates = [make_candidate(number, provider_id=f"prv_{number % 2}") for number in range(4)]
    shortlist = Shortlist.of(candidates)

    assert shortlist.only([2, 0]).candidates == (candidates[2], candidates[0])
    assert shortlist.only([3, 2, 1, 0]).candidates == tuple(reversed(candidates))
    assert shortlist.only([]).is_empty
    assert shortlist.of_provider(ProviderId("prv_1")).candidates == (candidates[1], candidates[3])


def test_another_tariff_of_a_provider_holds_for_all_its_drones() -> None:
    shortlist = Shortlist.of([make_candidate(n, provider_id=f"prv_{n % 2}") for n in range(4)])
    before = shortlist.terms_of[ProviderId("prv_1")].tariff

    changed = shortlist.with_tariff(ProviderId("prv_1"), Tariff(base=7))

    assert [each.tariff.base for each in changed.candidates] == [before.base, 7, before.base, 7]
    assert changed.terms_of[ProviderId("prv_1")].tariff == Tariff(base=7)
    assert shortlist.terms_of[ProviderId("prv_1")].tariff == before
    assert shortlist.with_tariff(ProviderId("prv_9"), Tariff(base=7)) == shortlist
