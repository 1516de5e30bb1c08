"""Damages to one field of one step."""

import math
from collections.abc import Iterator

from skyway.delivery.plan import Deliver, PickUp, Plan, Recharge
from skyway.ids import PackageId, StationId
from tests.library.planner.damages.good_plan import GoodPlan, changed, meets

#: Far above every tolerance, far below the usual values of a plan.
SHIFTS = {
    "start_s": 0.001,
    "end_s": 0.001,
    "load_kg": 1e-6,
    "energy_j": 1.0,
    "soc_start": 1e-6,
    "soc_end": 1e-6,
    "time_factor": 1e-6,
    "energy_factor": 1e-6,
}


def each_number_shifted(good: GoodPlan) -> Iterator[Plan]:
    """A moment no longer equals its neighbour's, or a value no longer follows from physics."""
    for number, step in enumerate(good.steps):
        for name, shift in SHIFTS.items():
            if name in type(step).model_fields:
                for value in (getattr(step, name) - shift, getattr(step, name) + shift):
                    yield good.with_step(number, changed(step, **{name: value}))


def each_number_not_a_number(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        for name in SHIFTS:
            if name in type(step).model_fields:
                for value in (math.nan, math.inf, -math.inf):
                    yield good.with_step(number, changed(step, **{name: value}))


def each_number_in_other_units(good: GoodPlan) -> Iterator[Plan]:
    """Milliseconds, kilojoules, grams, percent. 0 is the same in every unit, so it is left out."""
    for number, step in enumerate(good.steps):
        for name in SHIFTS:
            value = getattr(step, name, 0.0)
            if value != 0:
                yield good.with_step(number, changed(step, **{name: value * 1000}))
                yield good.with_step(number, changed(step, **{name: value / 1000}))


def each_place_changed(good: GoodPlan) -> Iterator[Plan]:
    """A step starts where the step before ended; the last delivery is at its destination."""
    for number, step in enumerate(good.steps):
        for name in ("station_id", "from_id", "to_id"):
            if name in type(step).model_fields:
                for other in (*good.problem.network.stations, StationId("nowhere")):
                    if other != getattr(step, name):
                        yield good.with_step(number, changed(step, **{name: other}))


def each_pad_missing(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, Recharge):
            for pad in (-1, good.problem.network.stations[step.station_id].pads):
                yield good.with_step(number, changed(step, pad=pad))


def each_pad_reserved(good: GoodPlan) -> Iterator[Plan]:
    """Only pads whose reservation overlaps the session: moving to a free pad breaks no rule."""
    for number, step in good.recharges:
        for held in good.problem.pad_reservations:
            if meets(step, held):
                yield good.with_step(number, changed(step, pad=held.pad))


def each_package_list_changed(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, PickUp | Deliver):
            for ids in (
                (),
                step.package_ids[1:],
                (*step.package_ids, step.package_ids[0]),
                (*step.package_ids, PackageId("unknown")),
                (PackageId("unknown"), *step.package_ids[1:]),
            ):
                yield good.with_step(number, changed(step, package_ids=ids))


#: All damages of this file.
DAMAGES = (
    each_number_shifted,
    each_number_not_a_number,
    each_number_in_other_units,
    each_place_changed,
    each_pad_missing,
    each_pad_reserved,
    each_package_list_changed,
)
