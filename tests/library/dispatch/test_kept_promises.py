"""Promises that are broken only by the order of planning are kept in another order."""

import pytest

from skyway.dispatch.kept_promises import repaired
from skyway.dispatch.optimise import begun
from skyway.dispatch.problem import CurrentTrip
from skyway.dispatch.schedule import Schedule, Scheduler
from tests.library.dispatch.fleets import small_fleet

_DRONES = 3

#: Fleets in which the drone that is free first takes the pad of a trip that was promised before.
_SEEDS = [4, 6, 8, 15, 21, 22, 35]


def _late(schedule: Schedule, latest_s: dict[int, float]) -> list[int]:
    come = schedule.costs.delivered_s
    return [each for each, moment_s in latest_s.items() if come[each] > moment_s]


@pytest.mark.parametrize("seed", _SEEDS)
def test_a_late_trip_is_planned_before_those_that_take_its_pads(seed: int) -> None:
    scheduler = Scheduler(small_fleet(seed, drones=_DRONES, requests=6))
    promised = scheduler.arrival_order()
    latest_s = {**promised.costs.delivered_s}
    sequences = promised.sequences(_DRONES)
    broken = scheduler.planned(sequences)

    kept = repaired(scheduler, broken, latest_s)

    assert _late(broken, latest_s)
    assert _late(kept, latest_s) == []
    assert kept.sequences(_DRONES) == sequences


def test_a_promise_that_no_order_keeps_leaves_the_schedule_as_it_is() -> None:
    scheduler = Scheduler(small_fleet(1, drones=_DRONES, requests=6))
    found = scheduler.arrival_order()

    assert repaired(scheduler, found, dict.fromkeys(range(6), -1e9)).costs == found.costs
    assert repaired(scheduler, found, {}) is found


@pytest.mark.parametrize("seed", _SEEDS)
def test_the_search_begins_at_a_current_plan_that_keeps_its_promises(seed: int) -> None:
    fleet = small_fleet(seed, drones=_DRONES, requests=6)
    first = Scheduler(fleet).arrival_order()
    drones = {number: each for each, trip in first.trips for number in trip.pool}
    starts = {number: trip.slot.at_ms / 1000 for _, trip in first.trips for number in trip.pool}
    requests = tuple(
        each.model_copy(
            update={
                "planned": CurrentTrip(
                    drone_id=fleet.drones[drones[number]].drone_id, start_s=starts[number]
                ),
                "promised_s": first.costs.delivered_s[number],
            }
        )
        for number, each in enumerate(fleet.requests)
    )
    changed = {"requests": requests, "baseline": "current plan", "promise_tolerance_s": 0.0}

    search = begun(fleet.model_copy(update=changed))

    assert search.limits.latest_s == first.costs.delivered_s
