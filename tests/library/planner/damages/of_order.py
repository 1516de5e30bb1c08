"""Damages to which steps there are, and in which order."""

from collections.abc import Iterator

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge, Wait
from tests.library.planner.damages.good_plan import GoodPlan, changed, fitted, is_empty
from tests.library.planner.outcomes import delivery_time_s


def each_step_dropped(good: GoodPlan) -> Iterator[Plan]:
    """Without a step there is a gap in time or on the map, or packages are not handed over."""
    for number, step in enumerate(good.steps):
        if not is_empty(step):
            yield good.with_step(number)


def each_step_dropped_and_the_gap_closed(good: GoodPlan) -> Iterator[Plan]:
    """A missing flight breaks the route; a recharge, the charge; a handover, the delivery.

    No wait is dropped: some strategies wait longer than they have to.
    """
    for number, step in enumerate(good.steps):
        if not isinstance(step, Wait) and not is_empty(step):
            yield fitted(good.plan, good.with_step(number).steps)


def each_step_twice(good: GoodPlan) -> Iterator[Plan]:
    """A repeated step starts before its first end, or hands over packages a second time."""
    for number, step in enumerate(good.steps):
        if not is_empty(step):
            yield good.with_step(number, step, step)


def neighbours_swapped(good: GoodPlan) -> Iterator[Plan]:
    """Both steps keep their times, so one comes too early and the other too late."""
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
    yield good.having(steps=tuple(steps), delivery_time_s=delivery_time_s(good.plan) + 1)


def something_after_the_last_delivery(good: GoodPlan) -> Iterator[Plan]:
    """A recharge here matters most: it could bring an unreachable finish within reach."""
    last = good.steps[-1]
    assert isinstance(last, Deliver | PickUp)
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


def a_wait_before_a_hand_over(good: GoodPlan) -> Iterator[Plan]:
    """The rest of the plan is made to fit: only the rule against such waits is broken."""
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


#: All damages of this file.
DAMAGES = (
    each_step_dropped,
    each_step_dropped_and_the_gap_closed,
    each_step_twice,
    neighbours_swapped,
    all_steps_reversed,
    no_steps,
    the_whole_plan_later,
    something_after_the_last_delivery,
    a_wait_before_a_hand_over,
    a_wait_of_negative_length,
    a_recharge_in_the_air,
)
