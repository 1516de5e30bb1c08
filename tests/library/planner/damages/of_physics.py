"""Damages to the physics of flights and recharges; the rest of the plan is made to fit."""

from collections.abc import Iterator

from skyway.delivery.plan import Fly, Plan, Recharge, Step, Wait
from tests.library.planner.damages.good_plan import GoodPlan, changed, fitted
from tests.library.planner.damages.good_plans import MODEL


def every_flight_faster(good: GoodPlan) -> Iterator[Plan]:
    """All flights faster than the model's speed; the rest is made to fit."""
    yield fitted(good.plan, [_faster(step) for step in good.steps])


def _faster(step: Step) -> Step:
    if not isinstance(step, Fly):
        return step
    return changed(step, end_s=step.start_s + 0.99 * (step.end_s - step.start_s))


def every_flight_with_less_energy(good: GoodPlan) -> Iterator[Plan]:
    """Stated charge and energy agree with each other, but not with the model's power."""
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
    """The same charge in less time; the rest is made to fit."""
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


#: All damages of this file.
DAMAGES = (
    every_flight_faster,
    every_flight_with_less_energy,
    every_landing_free,
    each_recharge_sooner_over,
    each_recharge_a_discharge,
    each_recharge_above_the_top,
    each_recharge_a_wait,
)
