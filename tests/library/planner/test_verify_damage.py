"""Good plans of all kinds, damaged in every way: `verify` refuses each one.

A damage is a function from a good plan to plans that are good no more; why none of them can be
good is argued where it is made. What is changed without breaking a rule is in
`test_a_change_that_breaks_no_rule_is_accepted`.
"""

import math
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

from skyway.delivery.plan import (
    Deliver,
    Fly,
    Infeasibility,
    PackageDelivery,
    PickUp,
    Plan,
    Recharge,
    Step,
    Wait,
)
from skyway.drone.model import ChargePoint, DroneModel
from skyway.ids import DroneModelId, PackageId, StationId
from skyway.planner import compose
from skyway.planner.pad_book import OPEN_MS, PadBook
from skyway.planner.problem import Problem
from skyway.planner.verify import verify

#: Flies about 10 km; slower and thirstier when loaded; landings cost; never quite full.
MODEL = DroneModel(
    model_id=DroneModelId("all-features"),
    empty_mass_kg=5.0,
    max_payload_kg=4.0,
    battery_j=100_000.0,
    reserve_soc=0.1,
    speed_empty_mps=12.0,
    speed_full_mps=9.0,
    power_empty_w=90.0,
    stop_s=7.0,
    stop_j=150.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(1000, 0.8), ChargePoint(2000, 0.97)),
)

#: Far above every tolerance, far below everything that a plan is about.
SHIFTS = {
    "start_s": 0.001,
    "end_s": 0.001,
    "load_kg": 1e-6,
    "energy_j": 1.0,
    "soc_start": 1e-6,
    "soc_end": 1e-6,
}


@dataclass(frozen=True, slots=True)
class GoodPlan:
    """A problem with a plan for it; `name` tells which."""

    name: str
    problem: Problem
    plan: Plan

    @property
    def steps(self) -> tuple[Step, ...]:
        return self.plan.steps

    @property
    def recharges(self) -> list[tuple[int, Recharge]]:
        """The recharges that charge something, with their numbers."""
        return [
            (number, step)
            for number, step in enumerate(self.steps)
            if isinstance(step, Recharge) and not is_empty(step)
        ]

    def having(self, **fields: Any) -> Plan:
        """The plan with these fields, and nothing else made to fit."""
        return self.plan.model_copy(update=fields)

    def with_step(self, number: int, *instead: Step) -> Plan:
        """The plan with other steps in place of one."""
        return self.having(steps=(*self.steps[:number], *instead, *self.steps[number + 1 :]))


Damage = Callable[[GoodPlan], Iterable[Plan]]


def is_empty(step: Step) -> bool:
    """Whether it is a wait or a recharge that takes no time: with or without it, all is the same.

    Of a drone on the ground, that is; that nobody lands for nothing, `a_recharge_in_the_air` shows.
    """
    return isinstance(step, Wait | Recharge) and step.end_s - step.start_s < 1e-4


def changed(step: Step, **fields: Any) -> Step:
    return step.model_copy(update=fields)


def fitted(plan: Plan, steps: Sequence[Step]) -> Plan:
    """These steps one after another, each as long as it is, with sums and deliveries to match."""
    now_s, laid = 0.0, []
    for step in steps:
        laid.append(changed(step, start_s=now_s, end_s=now_s + (step.end_s - step.start_s)))
        now_s = laid[-1].end_s

    def total_s(kind: type[Step]) -> float:
        return math.fsum(step.end_s - step.start_s for step in laid if isinstance(step, kind))

    return plan.model_copy(
        update={
            "status": "feasible",
            "lower_bound_s": None,
            "steps": tuple(laid),
            "delivery_time_s": now_s,
            "energy_j": math.fsum(step.energy_j for step in laid if isinstance(step, Fly)),
            "flight_s": total_s(Fly),
            "waiting_s": total_s(Wait),
            "recharging_s": total_s(Recharge),
            "deliveries": tuple(
                PackageDelivery(
                    package_id=package_id, station_id=step.station_id, delivered_s=step.end_s
                )
                for step in laid
                if isinstance(step, Deliver)
                for package_id in step.package_ids
            ),
        }
    )


# Good plans.


def random_problem(seed: int) -> dict[str, Any]:
    """A problem with a bit of everything, on six to eight stations a few kilometres apart."""
    chance = random.Random(seed)
    names = [f"s{number}" for number in range(chance.randint(6, 8))]
    places = {name: (chance.uniform(0, 0.12), chance.uniform(0, 0.08)) for name in names}
    features: list[dict[str, Any]] = [
        _feature("Point", places[name], kind="station", station_id=name, pads=chance.choice((1, 2)))
        for name in names
    ]
    for number, name in enumerate(names):
        for other in names[:number]:
            away = math.dist(places[name], places[other])
            if other == names[number - 1] or away < 0.05:
                line = [places[name], places[other]]
                length_m = min(away * 80_000, 6_000)
                ends = {"from": name, "to": other}
                features.append(
                    _feature("LineString", line, kind="segment", length_m=length_m, **ends)
                )
    west, south = chance.uniform(0, 0.1), chance.uniform(0, 0.06)
    ring = [[west, south], [west + 0.01, south], [west, south + 0.01], [west, south]]
    until = f"2026-01-01T00:{chance.randint(2, 30):02}:00Z"
    features.append(_feature("Polygon", [ring], kind="zone", zone_id="z", active_until=until))
    source, *others = chance.sample(names, 5)
    destinations = [*others[: chance.randint(1, 3)], *([source] if seed % 5 == 0 else [])]
    return {
        "network": {"type": "FeatureCollection", "features": features},
        "start_at": "2026-01-01T00:00:00Z",
        "drone": {
            "model": MODEL,
            "soc": chance.uniform(0.5, 1.0),
            "station_id": others[3] if seed % 3 == 0 else None,
        },
        "source": source,
        "packages": [
            {"package_id": f"p{number}", "mass_kg": chance.uniform(0, 0.9), "destination": name}
            for number, name in enumerate([*destinations, destinations[0]])
        ],
        "pad_reservations": [
            {"station_id": name, "pad": 0, "start_s": start_s, "end_s": start_s + 900}
            for name in names
            for start_s in (chance.uniform(0, 500), chance.uniform(1500, 2500))
        ],
        "closures": [
            {"station_id": names[0], "start_s": 0, "end_s": 400},
            {"from": names[1], "to": names[0], "start_s": 100, "end_s": 800},
        ],
        "strategy": (None, "heuristic")[seed % 2],
        "recharge_policy": chance.choice(("partial", "full")),
        "finish": chance.choice(("recharge", "stay")),
        "loading_s": chance.choice((0.0, 45.0)),
        "dropoff_s": chance.choice((0.0, 20.0)),
    }


def _feature(shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": properties,
    }


@cache
def good_plans() -> tuple[GoodPlan, ...]:
    """A few dozen plans that the planner made and `verify` accepted."""
    made = []
    for seed in range(60):
        problem = Problem.model_validate(random_problem(seed))
        plan = compose(problem)
        if plan.is_flyable:
            made.append(GoodPlan(f"plan {seed}", problem, plan))
    return tuple(made)


# Damages to one field.


def each_number_shifted(good: GoodPlan) -> Iterator[Plan]:
    """A moment no longer meets its neighbour's, or a measure no longer what physics says."""
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
    """Milliseconds, kilojoules, grams, percent; 0 is 0 in every unit, and left out."""
    for number, step in enumerate(good.steps):
        for name in SHIFTS:
            value = getattr(step, name, 0.0)
            if value != 0:
                yield good.with_step(number, changed(step, **{name: value * 1000}))
                yield good.with_step(number, changed(step, **{name: value / 1000}))


def each_place_another(good: GoodPlan) -> Iterator[Plan]:
    """A step is where the one before ended; the last, a delivery, where its packages go."""
    for number, step in enumerate(good.steps):
        for name in ("station_id", "from_id", "to_id"):
            if name in type(step).model_fields:
                for other in (*good.problem.network.stations, StationId("nowhere")):
                    if other != getattr(step, name):
                        yield good.with_step(number, changed(step, **{name: other}))


def each_pad_one_that_is_not_there(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, Recharge):
            for pad in (-1, good.problem.network.stations[step.station_id].pads):
                yield good.with_step(number, changed(step, pad=pad))


def each_pad_one_that_is_taken(good: GoodPlan) -> Iterator[Plan]:
    """Only onto reservations that the session meets; another pad that is free breaks no rule."""
    for number, step in good.recharges:
        for held in good.problem.pad_reservations:
            if _meets(step, held):
                yield good.with_step(number, changed(step, pad=held.pad))


def each_package_list_another(good: GoodPlan) -> Iterator[Plan]:
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


def _meets(step: Recharge, held: Any) -> bool:
    return (
        held.station_id == step.station_id
        and step.start_s < held.end_s - 0.01
        and held.start_s < step.end_s - 0.01
    )


# Damages to the order of steps.


def each_step_dropped(good: GoodPlan) -> Iterator[Plan]:
    """It leaves a gap in time, a gap on the map, or packages that never change hands."""
    for number, step in enumerate(good.steps):
        if not is_empty(step):
            yield good.with_step(number)


def each_step_dropped_and_the_gap_closed(good: GoodPlan) -> Iterator[Plan]:
    """A flight is missing on the map, a recharge in the battery, a handover at the end.

    Waits stay: some strategies wait longer than they have to.
    """
    for number, step in enumerate(good.steps):
        if not isinstance(step, Wait) and not is_empty(step):
            yield fitted(good.plan, good.with_step(number).steps)


def each_step_twice(good: GoodPlan) -> Iterator[Plan]:
    """What takes time begins before it ended; what takes none is a handover of nothing."""
    for number, step in enumerate(good.steps):
        if not is_empty(step):
            yield good.with_step(number, step, step)


def neighbours_swapped(good: GoodPlan) -> Iterator[Plan]:
    """Both at their own times: what takes time comes too early, what takes none too late."""
    for number in range(len(good.steps) - 1):
        first, second = good.steps[number : number + 2]
        if not (is_empty(first) or is_empty(second)):
            swapped = (*good.steps[:number], second, first, *good.steps[number + 2 :])
            yield good.having(steps=swapped)


def all_steps_reversed(good: GoodPlan) -> Iterator[Plan]:
    yield good.having(steps=good.steps[::-1])


def no_steps(good: GoodPlan) -> Iterator[Plan]:
    yield good.having(steps=())
    yield fitted(good.plan, ())


def the_whole_plan_later(good: GoodPlan) -> Iterator[Plan]:
    """A plan begins at time 0."""
    steps = [changed(s, start_s=s.start_s + 1, end_s=s.end_s + 1) for s in good.steps]
    yield good.having(steps=tuple(steps), delivery_time_s=good.plan.delivery_time_s + 1)


def something_after_the_last_delivery(good: GoodPlan) -> Iterator[Plan]:
    """Above all no recharge, by which a finish out of reach would come within it."""
    last = good.steps[-1]
    end_s, here = last.end_s, last.station_id
    soc = next(step.soc_end for step in reversed(good.steps) if isinstance(step, Fly | Recharge))
    segment = good.problem.network.segments_from(here)[0]
    extra = (
        Wait(station_id=here, start_s=end_s, end_s=end_s + 60),
        Wait(station_id=here, start_s=end_s, end_s=end_s),
        Deliver(station_id=here, package_ids=(), start_s=end_s, end_s=end_s),
        Recharge(
            station_id=here, pad=0, start_s=end_s, end_s=end_s, soc_start=soc, soc_end=soc
        ),
        Fly(
            from_id=here, to_id=segment.to_id, start_s=end_s, end_s=end_s + 60,
            load_kg=0, energy_j=0, soc_end=soc,
        ),
    )  # fmt: skip
    for step in extra:
        yield good.having(steps=(*good.steps, step))
        yield fitted(good.plan, (*good.steps, step))


def a_wait_before_packages_change_hands(good: GoodPlan) -> Iterator[Plan]:
    """Everything else is made to fit: only the rule against it is broken."""
    for number, step in enumerate(good.steps):
        if isinstance(step, PickUp | Deliver):
            for duration_s in (0.0, 60.0):
                wait = Wait(station_id=step.station_id, start_s=0.0, end_s=duration_s)
                yield fitted(good.plan, good.with_step(number, wait, step).steps)


def a_wait_of_negative_length(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, Fly):
            wait = Wait(station_id=step.from_id, start_s=60.0, end_s=0.0)
            yield fitted(good.plan, good.with_step(number, wait, step).steps)


def a_recharge_in_the_air(good: GoodPlan) -> Iterator[Plan]:
    """At a station flown over: its flight pays for no landing, and landings cost this drone."""
    for number, (step, following) in enumerate(zip(good.steps, good.steps[1:], strict=False)):
        if isinstance(step, Fly) and isinstance(following, Fly):
            charge = {"soc_start": step.soc_end, "soc_end": step.soc_end}
            recharge = Recharge(station_id=step.to_id, pad=0, start_s=0, end_s=0, **charge)
            yield fitted(good.plan, good.with_step(number, step, recharge).steps)


# Damages to what flights and recharges are.


def every_flight_faster(good: GoodPlan) -> Iterator[Plan]:
    """All else made to fit; the speed is the model's."""
    yield fitted(good.plan, [_faster(step) for step in good.steps])


def _faster(step: Step) -> Step:
    if not isinstance(step, Fly):
        return step
    return changed(step, end_s=step.start_s + 0.99 * (step.end_s - step.start_s))


def every_flight_thriftier(good: GoodPlan) -> Iterator[Plan]:
    """The charge told agrees with the energy told; neither with the model's power."""
    spared_soc, steps = 0.0, []
    for step in good.steps:
        if isinstance(step, Fly):
            spared_soc += 0.01 * step.energy_j / MODEL.battery_j
            fields = {"energy_j": 0.99 * step.energy_j, "soc_end": step.soc_end + spared_soc}
            steps.append(changed(step, **fields))
        elif isinstance(step, Recharge):
            fields = {"soc_start": step.soc_start + spared_soc}
            spared_soc = 0.0
            steps.append(changed(step, **fields))
        else:
            steps.append(step)
    yield fitted(good.plan, steps)


def every_landing_free(good: GoodPlan) -> Iterator[Plan]:
    steps = list(good.steps)
    for number, step in enumerate(steps):
        if isinstance(step, Fly) and not isinstance(steps[number + 1], Fly):
            steps[number] = changed(step, end_s=step.end_s - MODEL.stop_s)
    yield fitted(good.plan, steps)


def each_recharge_sooner_over(good: GoodPlan) -> Iterator[Plan]:
    """The same charge in less time, all else made to fit."""
    for number, step in good.recharges:
        end_s = step.start_s + 0.9 * (step.end_s - step.start_s)
        yield fitted(good.plan, good.with_step(number, changed(step, end_s=end_s)).steps)


def each_recharge_a_discharge(good: GoodPlan) -> Iterator[Plan]:
    for number, step in good.recharges:
        turned = {"soc_start": step.soc_end, "soc_end": step.soc_start}
        yield good.with_step(number, changed(step, **turned))


def each_recharge_above_the_top(good: GoodPlan) -> Iterator[Plan]:
    for number, step in good.recharges:
        yield good.with_step(number, changed(step, soc_end=MODEL.top_soc + 0.01))


def each_recharge_a_wait(good: GoodPlan) -> Iterator[Plan]:
    for number, step in good.recharges:
        times = {"start_s": step.start_s, "end_s": step.end_s}
        wait = Wait(station_id=step.station_id, **times)
        yield fitted(good.plan, good.with_step(number, wait).steps)


# Damages to what the plan says of itself.


def each_sum_wrong(good: GoodPlan) -> Iterator[Plan]:
    for name in ("delivery_time_s", "energy_j", "flight_s", "waiting_s", "recharging_s"):
        value = getattr(good.plan, name)
        for other in (value - 0.01, value + 0.01, -value - 1, None, math.nan, math.inf):
            yield good.having(**{name: other})


def deliveries_that_tell_something_else(good: GoodPlan) -> Iterator[Plan]:
    deliveries = good.plan.deliveries
    yield good.having(deliveries=())
    for number, told in enumerate(deliveries):
        others = (*deliveries[:number], *deliveries[number + 1 :])
        yield good.having(deliveries=others)
        yield good.having(deliveries=(*deliveries, told))
        for fields in (
            {"package_id": "unknown"},
            {"station_id": "nowhere"},
            {"delivered_s": told.delivered_s - 0.001},
            {"delivered_s": told.delivered_s + 0.001},
            {"delivered_s": math.nan},
        ):
            yield good.having(deliveries=(*others, told.model_copy(update=fields)))


def a_bound_that_is_none(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (good.plan.delivery_time_s + 0.001, math.inf, math.nan):
        yield good.having(lower_bound_s=bound_s)


def a_proof_that_is_none(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (None, 0.0, good.plan.delivery_time_s - 0.001, math.nan):
        yield good.having(status="optimal", lower_bound_s=bound_s)


def a_plan_that_denies_itself(good: GoodPlan) -> Iterator[Plan]:
    why = Infeasibility(code="OUT_OF_RANGE", detail="or so")
    yield good.having(infeasibility=why)
    for status in ("infeasible", "unknown"):
        yield good.having(status=status)
        yield good.having(status=status, infeasibility=why)
        yield good.having(status=status, infeasibility=why, steps=(), deliveries=())


DAMAGES: tuple[Damage, ...] = (
    each_number_shifted,
    each_number_not_a_number,
    each_number_in_other_units,
    each_place_another,
    each_pad_one_that_is_not_there,
    each_pad_one_that_is_taken,
    each_package_list_another,
    each_step_dropped,
    each_step_dropped_and_the_gap_closed,
    each_step_twice,
    neighbours_swapped,
    all_steps_reversed,
    no_steps,
    the_whole_plan_later,
    something_after_the_last_delivery,
    a_wait_before_packages_change_hands,
    a_wait_of_negative_length,
    a_recharge_in_the_air,
    every_flight_faster,
    every_flight_thriftier,
    every_landing_free,
    each_recharge_sooner_over,
    each_recharge_a_discharge,
    each_recharge_above_the_top,
    each_recharge_a_wait,
    each_sum_wrong,
    deliveries_that_tell_something_else,
    a_bound_that_is_none,
    a_proof_that_is_none,
    a_plan_that_denies_itself,
)


# Changes that are no damage.


def each_pad_one_that_is_free(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, Recharge):
            for pad in range(good.problem.network.stations[step.station_id].pads):
                holders = [held for held in good.problem.pad_reservations if held.pad == pad]
                if not any(_meets(step, held) for held in holders):
                    yield good.with_step(number, changed(step, pad=pad))


def lists_in_another_order(good: GoodPlan) -> Iterator[Plan]:
    yield good.having(deliveries=good.plan.deliveries[::-1])
    for number, step in enumerate(good.steps):
        if isinstance(step, PickUp | Deliver):
            yield good.with_step(number, changed(step, package_ids=step.package_ids[::-1]))


def less_is_claimed(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (None, 0.0, good.plan.delivery_time_s):
        yield good.having(status="feasible", lower_bound_s=bound_s)
    yield good.having(status="optimal", lower_bound_s=good.plan.delivery_time_s, stats={})


def each_number_off_by_rounding(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        for name in ("start_s", "end_s", "energy_j"):
            if name in type(step).model_fields:
                value = getattr(step, name) + 1e-9
                yield good.with_step(number, changed(step, **{name: value}))


HARMLESS: tuple[Damage, ...] = (
    each_pad_one_that_is_free,
    lists_in_another_order,
    less_is_claimed,
    each_number_off_by_rounding,
)


def test_the_good_plans_are_good_and_of_all_kinds():
    kinds = Counter(step.kind for good in good_plans() for step in good.steps)

    assert len(good_plans()) >= 24
    assert min(kinds[kind] for kind in ("PICK_UP", "FLY", "WAIT", "RECHARGE", "DELIVER")) >= 10
    for good in good_plans():
        assert verify(good.problem, good.plan) == ()
        assert verify(good.problem, fitted(good.plan, good.steps)) == ()


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_every_damage_is_refused(damage: Damage):
    damaged = [(good, plan) for good in good_plans() for plan in damage(good)]

    unseen = [(good.name, plan) for good, plan in damaged if not verify(good.problem, plan)]

    assert len(damaged) >= 10
    assert unseen == []


@pytest.mark.parametrize("change", HARMLESS, ids=lambda change: change.__name__)
def test_a_change_that_breaks_no_rule_is_accepted(change: Damage):
    harmless = [(good, plan) for good in good_plans() for plan in change(good)]

    refused = [found for good, plan in harmless if (found := verify(good.problem, plan))]

    assert len(harmless) >= 10
    assert refused == []


def test_a_pad_booked_beside_the_problem_is_refused():
    sessions = [(good, *recharge) for good in good_plans() for recharge in good.recharges]

    assert len(sessions) >= 10
    for good, number, step in sessions:
        start_ms, end_ms = math.floor(step.start_s * 1000), math.ceil(step.end_s * 1000)
        for held_ms, is_refused in (
            ((start_ms - 5000, start_ms), False),
            ((start_ms - 5000, start_ms + 2), True),
            ((start_ms + 1, end_ms - 1), True),
            ((end_ms - 2, OPEN_MS), True),
            ((end_ms, OPEN_MS), False),
        ):
            row = good.problem.network.row_of[step.station_id]
            book = PadBook.of_arrays(
                station=np.array([row]),
                pad=np.array([step.pad]),
                start_ms=np.array([7_000_000 + held_ms[0]]),
                end_ms=np.array([min(7_000_000 + held_ms[1], OPEN_MS)]),
            ).seen_from(7_000_000)

            found = verify(good.problem, good.plan, booked=book)

            rules = [violation.rule for violation in found if violation.step == number]
            assert rules == (["pad"] if is_refused else [])
