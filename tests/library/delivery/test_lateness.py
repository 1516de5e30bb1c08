"""The lateness that nine of ten packages do not exceed, learned from those that have come."""

import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.lateness import (
    BORROWED,
    FEWEST,
    UNKNOWN,
    Conditions,
    KnownAir,
    PackageArrival,
    late_share,
    later_by_s,
)
from tests.long_cases import sampled


def come(
    count: int, late_s: Callable[[int], float], *, was_covered: bool | None = None
) -> list[PackageArrival]:
    return [PackageArrival(1000.0, late_s(each), was_covered) for each in range(count)]


def test_nothing_is_forecast_from_few_packages() -> None:
    assert late_share(UNKNOWN, come(FEWEST - 1, float)) is None
    assert late_share(UNKNOWN, come(FEWEST, float)) is not None


def test_nine_of_ten_packages_come_within_the_forecast_lateness() -> None:
    assert late_share(UNKNOWN, come(99, lambda number: 10.0 * number)) == pytest.approx(0.89)


def test_packages_that_come_early_make_no_forecast_earlier_than_the_plan() -> None:
    assert late_share(UNKNOWN, come(100, lambda _: -60.0)) == 0.0


def test_lateness_in_a_short_plan_is_a_share_of_five_minutes() -> None:
    share = late_share(UNKNOWN, [PackageArrival(10.0, 60.0, None)] * 50)

    assert share == pytest.approx(0.2)
    assert later_by_s(10.0, 0.2) == pytest.approx(60.0)


def test_a_few_packages_that_lay_for_days_do_not_make_all_forecasts_days_later() -> None:
    on_time = come(90, lambda _: 0.0, was_covered=True)
    stuck = come(5, lambda _: 3 * 86_400.0, was_covered=False)

    share = late_share(UNKNOWN, [*on_time, *stuck])

    assert share is not None
    assert share <= 3.0
    assert late_share(UNKNOWN, come(90, lambda _: 3 * 86_400.0)) == 3.0


def test_the_forecast_widens_after_misses_and_narrows_after_hits() -> None:
    usual = late_share(UNKNOWN, come(100, float))
    missed = late_share(UNKNOWN, come(100, float, was_covered=False))
    hit = late_share(UNKNOWN, come(100, float, was_covered=True))

    assert usual is not None
    assert missed is not None
    assert hit is not None
    assert hit < usual < missed


def test_a_long_calm_narrows_and_a_long_storm_widens_the_forecast_only_so_far() -> None:
    calm = late_share(UNKNOWN, come(300, float, was_covered=True))
    storm = come(150, float, was_covered=False)

    assert calm is not None
    assert calm >= 0.18  # three of five packages
    # A few calm days later not the latest package of all decides.
    after = late_share(UNKNOWN, [*storm, *come(60, float, was_covered=True)])
    assert after is not None
    assert after < 0.14


def days(chance: random.Random) -> Iterator[float]:
    """The lateness of packages in seconds: calm days, a stormy day, calm days again."""
    for spread_s in (60.0, 600.0, 60.0):
        for _ in range(600):
            yield max(0.0, chance.gauss(0.3 * spread_s, spread_s))


@pytest.mark.parametrize("seed", sampled(range(3), every=3))
def test_about_nine_of_ten_packages_come_by_their_p90_although_the_weather_changes(
    seed: int,
) -> None:
    arrivals: list[PackageArrival] = []
    for late_s in days(random.Random(seed)):
        share = late_share(UNKNOWN, arrivals[-300:])
        was_covered = None if share is None else late_s <= later_by_s(1000.0, share)
        arrivals.append(PackageArrival(1000.0, late_s, was_covered))

    covered = [each.was_covered for each in arrivals if each.was_covered is not None]
    assert 0.87 <= sum(covered) / len(covered) <= 0.93


def in_wind(wind_mps: float, *, recharges: int = 0) -> Conditions:
    """What is known of a plan in this wind."""
    air = KnownAir(source="FORECAST", wind_mps=wind_mps, temperature_c=15.0)
    return Conditions(air=air, recharges=recharges)


def under(known: Conditions, arrivals: Iterable[PackageArrival]) -> list[PackageArrival]:
    return [replace(each, known=known) for each in arrivals]


def test_packages_in_the_same_weather_decide_the_p90() -> None:
    calm, storm = in_wind(1.0), in_wind(9.0)
    mixed = [*under(calm, come(60, lambda _: 0.0)), *under(storm, come(60, lambda _: 500.0))]

    assert late_share(calm, mixed) == 0.0
    assert late_share(storm, mixed) == pytest.approx(0.5)


def test_all_packages_count_while_none_was_promised_in_such_weather() -> None:
    calm = under(in_wind(1.0), come(99, lambda number: 10.0 * number))

    assert late_share(in_wind(20.0), calm) == pytest.approx(0.89)


def test_a_wind_that_is_measured_says_nothing_about_plans_in_a_forecast() -> None:
    air = KnownAir(source="MEASURED", wind_mps=9.0, temperature_c=15.0)
    measured = under(Conditions(air=air), come(60, lambda _: 500.0))
    forecast = under(in_wind(9.0), come(60, lambda _: 100.0))

    assert late_share(in_wind(9.0), [*measured, *forecast]) == pytest.approx(0.1)


def test_misses_of_plans_with_as_many_recharges_widen_the_p90_most() -> None:
    def share_after_misses_with(recharges: int) -> float:
        usual = under(in_wind(3.0, recharges=2), come(100, float))
        missed = under(in_wind(30.0, recharges=recharges), come(5, float, was_covered=False))
        return late_share(in_wind(3.0, recharges=2), [*usual, *missed]) or 0.0

    assert share_after_misses_with(2) > share_after_misses_with(1)


@pytest.mark.parametrize(
    ("wind_mps", "temperature_c", "weather"),
    [(1.9, 15.0, "CALM"), (2.0, 15.0, "WINDY"), (6.0, 15.0, "STORMY"), (6.0, 4.0, "COLD")],
)
def test_people_see_the_weather_in_a_word(
    wind_mps: float, temperature_c: float, weather: str
) -> None:
    air = KnownAir(source="MEASURED", wind_mps=wind_mps, temperature_c=temperature_c)

    assert Conditions(air=air, recharges=7).group == ("MEASURED", weather, 3)
    assert UNKNOWN.group == (None, None, 0)


@pytest.mark.parametrize("size", [20, 300, 5_000])
def test_the_largest_provider_does_not_decide_the_p90_of_a_new_one(size: int) -> None:
    large, small = come(size, lambda _: 0.0), come(20, lambda _: 500.0)

    # Both weigh the same, so more than one of ten packages comes late.
    assert late_share(UNKNOWN, [], [large, small]) == pytest.approx(0.5)
    if size > 20:
        assert late_share(UNKNOWN, [], [large, small[:4]]) == pytest.approx(0.5)


def test_the_more_packages_a_provider_has_the_less_other_providers_count() -> None:
    punctual, late = come(300, lambda _: 0.0), come(300, lambda _: 500.0)
    few = come(5, lambda number: 100.0 * number)

    assert late_share(UNKNOWN, few, [late]) == pytest.approx(0.5)
    assert late_share(UNKNOWN, few, [punctual]) == pytest.approx(0.1)
    assert late_share(UNKNOWN, punctual[:BORROWED], [late]) == pytest.approx(0.5)
    assert late_share(UNKNOWN, punctual, [late]) == 0.0


def test_few_packages_of_all_providers_together_give_no_late_share() -> None:
    assert late_share(UNKNOWN, [], [come(10, float)] * 3) is None
    assert late_share(UNKNOWN, come(10, float), [come(10, float)] * 3) is not None
    assert late_share(UNKNOWN, [], []) is None


@settings(max_examples=60)
@given(
    own=st.lists(st.floats(-1e3, 1e4), max_size=80),
    others=st.lists(st.lists(st.floats(-1e3, 1e4), max_size=80), max_size=4),
)
def test_the_late_share_is_a_score_that_was_seen_and_covers_enough_packages(
    own: list[float], others: list[list[float]]
) -> None:
    groups = [[PackageArrival(1000.0, each, None) for each in some] for some in (own, *others)]

    share = late_share(UNKNOWN, groups[0], groups[1:])

    if share is None:
        assert len(own) + sum(map(len, others)) < FEWEST
        return
    seen = [each / 1000.0 for some in (own, *others) for each in some]
    assert share in (0.0, 3.0) or any(share == pytest.approx(each) for each in seen)
    # The order of the other providers does not matter.
    assert late_share(UNKNOWN, groups[0], groups[:0:-1]) == pytest.approx(share)
    # More of the same lateness changes nothing about a provider whose packages agree.
    assert late_share(UNKNOWN, [PackageArrival(1000.0, 50.0, None)] * 500) == pytest.approx(0.05)
