from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from skyway.delivery.offer import (
    MOST_OF_TRIP,
    OfferValues,
    Price,
    Tariff,
    no_show_factor,
    price_of,
    rank_offers,
    total_price,
)
from skyway.delivery.qos import Priority, Weights
from skyway.delivery.request import MAX_PACKAGES
from skyway.ids import DroneId, ProviderId


def make_offer(
    provider: str, time_s: float = 100.0, price: int = 100, energy_j: float = 100.0
) -> OfferValues:
    return OfferValues(time_s, price, energy_j, ProviderId(provider), DroneId(f"drn_{provider}"))


def test_a_price_adds_up_base_distance_mass_and_recharging() -> None:
    tariff = Tariff(base=500, per_km=20, per_kg=100, per_recharge_minute=2)

    price = price_of(tariff, distance_m=10_500, payload_kg=2.5, recharging_s=600)

    assert (price.amount, price.currency) == (500 + 210 + 250 + 20, "USD")


@pytest.mark.parametrize("rate", ["base", "per_km", "per_kg", "per_recharge_minute", "minimum"])
def test_the_dearest_tariff_has_a_price_that_a_delivery_of_many_trips_can_sum(rate: str) -> None:
    tariff = Tariff.model_validate({rate: 10**12, "priority_factor": 10})

    price = price_of(tariff, distance_m=1e9, payload_kg=1e4, recharging_s=1e9, priority="PRIORITY")

    assert price.amount == MOST_OF_TRIP
    assert Price.read(total_price([price] * MAX_PACKAGES).model_dump_json())


def test_a_price_is_never_below_the_minimum() -> None:
    tariff = Tariff(base=1, minimum=700)

    assert price_of(tariff, distance_m=0, payload_kg=0, recharging_s=0).amount == 700


@pytest.mark.parametrize(("priority", "amount"), [("STANDARD", 705), ("PRIORITY", 846)])
def test_only_priority_multiplies_the_price(priority: Priority, amount: int) -> None:
    tariff = Tariff(base=500, per_km=20, priority_factor=1.2)

    price = price_of(tariff, distance_m=10_250, payload_kg=1, recharging_s=0, priority=priority)

    assert price.amount == amount


def test_priority_multiplies_the_minimum_too() -> None:
    tariff = Tariff(minimum=700, priority_factor=2)

    priced = price_of(tariff, distance_m=0, payload_kg=0, recharging_s=0, priority="PRIORITY")

    assert priced.amount == 1400


@pytest.mark.parametrize("factor", [0.99, 0, -1, 10.5, float("nan"), float("inf"), True, "2"])
def test_a_factor_outside_one_to_ten_is_refused(factor: object) -> None:
    with pytest.raises(ValidationError, match="priority_factor"):
        Tariff.model_validate({"priority_factor": factor})


@given(amount=st.integers(0, 10**12), factor=st.floats(0, 1))
def test_a_pooled_price_is_never_higher(amount: int, factor: float) -> None:
    price = Price(amount=amount, currency="USD")

    assert 0 <= price.pooled(Tariff(pooled_factor=factor)).amount <= amount


@given(
    tariff=st.builds(
        Tariff,
        base=st.integers(0, 10**6),
        per_km=st.integers(0, 10**4),
        per_kg=st.integers(0, 10**4),
        per_recharge_minute=st.integers(0, 10**3),
        minimum=st.integers(0, 10**6),
        priority_factor=st.floats(1, 10),
        pooled_factor=st.floats(0, 1),
    ),
    distance_m=st.floats(0, 10**6),
    payload_kg=st.floats(0, 100),
    recharging_s=st.floats(0, 10**5),
    priority=st.sampled_from(["STANDARD", "PRIORITY"]),
)
def test_the_line_items_of_a_price_sum_to_it(
    tariff: Tariff, distance_m: float, payload_kg: float, recharging_s: float, priority: Priority
) -> None:
    price = price_of(
        tariff,
        distance_m=distance_m,
        payload_kg=payload_kg,
        recharging_s=recharging_s,
        priority=priority,
    )

    for each in (price, price.pooled(tariff), total_price([price, price.pooled(tariff)])):
        assert sum(item.amount for item in each.itemised) == each.amount
        assert len({item.kind for item in each.itemised}) == len(each.itemised)
    rates = (tariff.base, tariff.per_km * distance_m / 1000, tariff.per_kg * payload_kg)
    for kind, exact in zip(("BASE", "DISTANCE", "MASS"), rates, strict=True):
        shown = sum(item.amount for item in price.line_items if item.kind == kind)
        assert abs(shown - exact) < 1.001


def test_a_price_whose_items_do_not_sum_to_it_is_refused() -> None:
    items = [{"kind": "BASE", "amount": 99}]

    with pytest.raises(ValidationError, match="sum to 99, not to the amount 100"):
        Price.model_validate({"amount": 100, "currency": "USD", "line_items": items})


def test_each_objective_picks_its_own_best_offer() -> None:
    offers = [
        make_offer("fast", time_s=50, price=300, energy_j=300),
        make_offer("cheap", time_s=300, price=50, energy_j=300),
        make_offer("green", time_s=300, price=300, energy_j=50),
    ]

    assert rank_offers(offers, Weights(time=1))[0] == 0
    assert rank_offers(offers, Weights(price=1))[0] == 1
    assert rank_offers(offers, Weights(energy=1))[0] == 2


def test_ties_go_to_the_lower_price_then_to_the_provider() -> None:
    offers = [make_offer("b"), make_offer("a"), make_offer("c", price=90)]

    assert rank_offers(offers, Weights(time=1)) == [2, 1, 0]


def test_a_free_offer_beats_all_others_on_price() -> None:
    offers = [make_offer("a", price=1), make_offer("b", price=0)]

    assert rank_offers(offers, Weights(price=1)) == [1, 0]


def test_no_offers_rank_to_nothing() -> None:
    assert rank_offers([], Weights(time=1)) == []


def test_the_first_no_show_costs_nothing_and_many_cost_a_quarter() -> None:
    factors = [no_show_factor(no_shows) for no_shows in (0, 1, 2, 3, 6, 7, 10**9)]

    assert factors == pytest.approx([1.0, 1.0, 1.05, 1.1, 1.25, 1.25, 1.25])
    assert factors[:2] == [1.0, 1.0]


def test_a_provider_with_repeated_no_shows_ranks_after_an_equal_one() -> None:
    weights = Weights(time=0.5, price=0.5)
    honest, absent = make_offer("z"), make_offer("a")
    much_cheaper = make_offer("b", price=50)

    def ranked(*offers: OfferValues) -> list[str]:
        return [offers[index].provider_id for index in rank_offers(offers, weights)]

    assert ranked(honest, absent) == ["a", "z"]
    assert ranked(honest, replace(absent, no_shows=1)) == ["a", "z"]
    assert ranked(honest, replace(absent, no_shows=2)) == ["z", "a"]
    assert ranked(honest, replace(much_cheaper, no_shows=100)) == ["b", "z"]
