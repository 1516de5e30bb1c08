"""Ends a standby early: the part of a plan before a moment."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from skyway.delivery.plan import Fly, Plan, Recharge, Step, Wait
from skyway.scheduling.trip import Trip

#: Moments that differ by less count as the same, in milliseconds: plans round them differently.
SAME_MS: Final = 2


def shortened_trip(trip: Trip, until_ms: int) -> Trip:
    """The trip whose standby ends at a moment, which is not before its last delivery."""
    until_s = (until_ms - trip.home_start_ms) / 1000
    home_plan, home_recharge = trip.home_plan, trip.home_recharge
    if (home_plan.delivery_time_s or 0.0) > until_s:
        home_plan = shortened_plan(home_plan, until_s)
    if home_recharge is not None:
        shortened = shortened_step(home_recharge, until_s)
        home_recharge = shortened if isinstance(shortened, Recharge) else None
    return replace(trip, home_plan=home_plan, home_recharge=home_recharge)


def shortened_plan(plan: Plan, until_s: float) -> Plan:
    """The plan up to a moment, in seconds since its start; its deliveries are left out."""
    steps = tuple(
        kept for step in plan.steps if (kept := shortened_step(step, until_s)) is not None
    )
    flights = [each for each in steps if isinstance(each, Fly)]
    return plan.model_copy(
        update={
            "steps": steps,
            "deliveries": (),
            "delivery_time_s": steps[-1].end_s if steps else 0.0,
            "energy_j": sum(each.energy_j for each in flights),
            "flight_s": _seconds(flights),
            "waiting_s": _seconds([each for each in steps if isinstance(each, Wait)]),
            "recharging_s": _seconds([each for each in steps if isinstance(each, Recharge)]),
        }
    )


def _seconds(steps: Sequence[Step]) -> float:
    return sum(each.end_s - each.start_s for each in steps)


def shortened_step(step: Step, until_s: float) -> Step | None:
    """The step up to a moment; None when it begins later."""
    same_s = SAME_MS / 1000
    if step.end_s <= until_s + same_s:
        return step
    if step.start_s >= until_s - same_s:
        return None
    update = {"end_s": until_s}
    if isinstance(step, Recharge):
        share = (until_s - step.start_s) / (step.end_s - step.start_s)
        # Charge curves are concave, so the drone has at least this.
        soc = step.soc_start + share * (step.soc_end - step.soc_start)
        return step.model_copy(update={**update, "soc_end": soc})
    return step.model_copy(update=update)
