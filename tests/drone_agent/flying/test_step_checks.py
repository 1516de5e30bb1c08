"""A drone flies only steps that follow from one another and that its battery can fly."""

from typing import Any

import pytest
from skyway_drone_agent.flying.step_checks import (
    fault_in,
    heaviest_load_kg,
    shortfall_of,
    stretch_of,
)

from skyway.drone.flight import flight_energy_j


def fault(made: Any, first_step: int = 1) -> str | None:
    return fault_in(made, first_step=first_step, packages=())


def test_a_whole_trip_has_no_fault(trip: Any) -> None:
    assert fault(trip) is None


def test_steps_begin_with_the_first_one_named(trip: Any) -> None:
    assert fault(trip, first_step=2) == "the steps do not begin with first_step 2"


def test_a_step_begins_where_the_one_before_ended(steps: Any) -> None:
    made = steps().fly("home", "shop", length_m=1, duration_s=1).wait("farm", duration_s=1).made

    assert fault(made) == "step 2 begins at farm, step 1 ends at shop"


def test_nothing_is_done_at_a_station_flown_over(steps: Any) -> None:
    made = (
        steps()
        .fly("home", "shop", length_m=1, duration_s=1, lands=False)
        .wait("shop", duration_s=1)
        .made
    )

    assert fault(made) == "step 2 needs a landing, step 1 flies over"


def test_the_last_step_is_on_the_ground(steps: Any) -> None:
    made = steps().fly("home", "shop", length_m=1, duration_s=1, lands=False).made

    assert fault(made) == "step 1 is the last and does not land"


def test_only_what_is_on_board_is_handed_over(steps: Any) -> None:
    made = steps().pick_up("home", p1=0.5).deliver("home", "p1").deliver("home", "p1").made

    assert fault(made) == "step 3 hands over ['p1'], not on board then"


def test_no_package_is_taken_on_twice(steps: Any) -> None:
    made = steps().pick_up("home", p1=0.5).pick_up("home", p1=0.5).made

    assert fault(made) == "step 2 takes on ['p1'] a second time"


def test_no_step_ends_before_it_starts(steps: Any) -> None:
    made = steps().wait("home", duration_s=-1).made

    assert fault(made) == "step 1 ends before it starts"


def test_the_heaviest_moment_counts(steps: Any) -> None:
    made = (
        steps()
        .pick_up("home", p1=0.5, p2=0.7)
        .deliver("home", "p2")
        .pick_up("home", p3=0.4)
        .bring_back("home", "p1", "p3")
        .made
    )

    assert heaviest_load_kg(made, ()) == pytest.approx(1.2)


def there_and_back(steps: Any, *, until_soc: float) -> Any:
    return (
        steps()
        .fly("home", "shop", length_m=40_000, duration_s=1)
        .recharge("shop", until_soc=until_soc, duration_s=1)
        .fly("shop", "farm", length_m=20_000, duration_s=1)
        .fly("farm", "home", length_m=20_000, duration_s=1)
        .made
    )


def test_a_recharge_that_gives_enough_carries_on(drone: Any, steps: Any) -> None:
    made = there_and_back(steps, until_soc=0.7)

    assert shortfall_of(made, model=drone.model, soc=1.0, packages=()) is None


def test_the_need_is_that_of_the_whole_stretch(drone: Any, steps: Any) -> None:
    made = there_and_back(steps, until_soc=0.6)

    shortfall = shortfall_of(made, model=drone.model, soc=1.0, packages=())

    assert shortfall is not None
    assert shortfall.step == made[3]
    assert shortfall.need_j == pytest.approx(2 * (1000 * 100 + 1000))
    assert shortfall.have_j == pytest.approx(0.5 * 360_000)


def test_a_drone_with_more_than_asked_keeps_it(drone: Any, steps: Any) -> None:
    made = (
        steps()
        .recharge("home", until_soc=0.2, duration_s=1)
        .fly("home", "shop", length_m=40_000, duration_s=1)
        .made
    )

    assert shortfall_of(made, model=drone.model, soc=0.9, packages=()) is None


def test_packages_on_board_count_as_load(drone: Any, steps: Any) -> None:
    made = steps().fly("home", "shop", length_m=60_000, duration_s=1).made
    (picked_up,) = steps().pick_up("home", p1=0.5).made

    empty = shortfall_of(made, model=drone.model, soc=1.0, packages=())
    loaded = shortfall_of(made, model=drone.model, soc=1.0, packages=picked_up.packages)

    assert empty is None
    assert loaded is not None


def test_flights_that_are_flown_anyway_count_but_are_not_judged(drone: Any, steps: Any) -> None:
    made = there_and_back(steps, until_soc=0.7)

    def short(*, soc: float, judged_from: int) -> Any:
        return shortfall_of(made, model=drone.model, soc=soc, packages=(), judged_from=judged_from)

    assert short(soc=0.3, judged_from=1).step == made[0]
    assert short(soc=0.3, judged_from=2) is None
    without_recharge = [made[0], *made[2:]]
    shortfall = shortfall_of(
        without_recharge, model=drone.model, soc=0.3, packages=(), judged_from=3
    )
    assert shortfall is not None
    assert shortfall.step == made[2]


def test_a_stretch_ends_before_the_next_recharge(steps: Any) -> None:
    made = there_and_back(steps, until_soc=0.6)

    assert stretch_of(tuple(made)) == (made[0],)
    assert stretch_of(tuple(made[2:])) == (made[2], made[3])


def test_a_drone_that_uses_more_than_its_model_says_is_judged_by_what_it_uses(
    drone: Any, steps: Any
) -> None:
    made = steps().fly("home", "shop", length_m=60_000, duration_s=1).made

    def judged(factor: float) -> Any:
        return shortfall_of(
            made, model=drone.model, soc=1.0, packages=(), energy_use=lambda _flights: factor
        )

    assert judged(1.0) is judged(1.07) is None
    assert judged(1.08).need_j == pytest.approx(1.08 * 60_000 / 20 * 100 + 1_000)


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.019])
def test_a_plan_that_uses_all_is_flown_by_a_drone_whose_sensors_err_a_little(
    drone: Any, steps: Any, factor: float
) -> None:
    made = steps().fly("home", "shop", length_m=64_600, duration_s=1).made

    shortfall = shortfall_of(
        made, model=drone.model, soc=1.0, packages=(), energy_use=lambda _flights: factor
    )

    assert shortfall is None


def test_the_felt_wind_counts_up_to_the_next_recharge_and_the_planned_weather_after_it(
    drone: Any, steps: Any
) -> None:
    made = there_and_back(steps, until_soc=0.7)
    asked: list[list[str]] = []

    def head_wind(flights: Any) -> float:
        asked.append([step.to_id for step, _ in flights])
        return 1.4 if flights else 1.0

    shortfall = shortfall_of(made, model=drone.model, soc=1.0, packages=(), energy_use=head_wind)
    in_planned_wind = [
        step.model_copy(update={"time_factor": 1.2}) if step.kind == "FLY" else step
        for step in made
    ]
    later = shortfall_of(
        in_planned_wind, model=drone.model, soc=1.0, packages=(), energy_use=head_wind
    )

    assert shortfall is None
    assert asked[:2] == [["shop"], []]
    assert later is not None
    assert later.step == in_planned_wind[3]
    assert later.need_j == pytest.approx(2 * (1.2 * 1000 * 100 + 1000))


@pytest.mark.parametrize("factors", [(1.0, 1.5), (1.5, 1.0)])
def test_the_planned_weather_counts_for_each_flight_with_its_load(
    drone: Any, steps: Any, factors: tuple[float, float]
) -> None:
    (picked_up,) = steps().pick_up("home", p1=2.0).made
    needed_j = 2 * drone.model.stop_j
    for load_kg, factor in zip((2.0, 0.0), factors, strict=True):
        needed_j += factor * flight_energy_j(drone.model, length_m=5_000, load_kg=load_kg)

    def short(spare_j: float) -> Any:
        until_soc = drone.model.reserve_soc + (needed_j + spare_j) / drone.model.battery_j
        made = (
            steps()
            .fly("home", "shop", length_m=1_000, duration_s=1)
            .recharge("shop", until_soc=until_soc, duration_s=1)
            .fly("shop", "farm", length_m=5_000, duration_s=1)
            .deliver("farm", "p1")
            .fly("farm", "home", length_m=5_000, duration_s=1)
            .made
        )
        for number, factor in zip((2, 4), factors, strict=True):
            made[number] = made[number].model_copy(update={"energy_factor": factor})
        return shortfall_of(made, model=drone.model, soc=0.2, packages=picked_up.packages)

    assert short(0.0) is None
    assert short(-0.05 * drone.model.battery_j).need_j == pytest.approx(needed_j)
