"""The charge to begin with: what the journal says, and what the plan has used since."""

from typing import Final

from skyway.contracts.flight_step import RechargeStep
from skyway.drone.charging import soc_after_recharge
from skyway.drone.model import DroneModel
from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.vehicles.reading import Reading
from skyway_drone_agent.vehicles.vehicle import StepRun

#: Error of the charge that the journal holds.
_JOURNAL_ERROR: Final = 0.02

#: Error of what a step under way has used or charged, as a share of it.
_PLAN_ERROR: Final = 0.25


def first_charge(
    reading: Reading,
    run: StepRun | None,
    leg: Leg | None,
    *,
    model: DroneModel,
    soc: float,
    capacity_j: float,
) -> tuple[float, float]:
    """The charge and its standard deviation, by a logbook that says `soc`.

    An agent that starts again in the middle of a step has not counted what came before.
    """
    by_now = soc
    if run is not None:
        elapsed_s = max(0.0, (reading.at - run.started_at).total_seconds())
        if leg is not None:
            by_now = soc - _used_j(reading, leg, elapsed_s, model=model) / capacity_j
        elif isinstance(run.step, RechargeStep) and soc < run.step.until_soc:
            on_curve = max(soc, model.charge_curve[0].soc)
            by_now = min(run.step.until_soc, soc_after_recharge(model, on_curve, elapsed_s))
    by_now = min(1.0, max(0.0, by_now))
    return by_now, _JOURNAL_ERROR + _PLAN_ERROR * abs(by_now - soc)


def _used_j(reading: Reading, leg: Leg, elapsed_s: float, *, model: DroneModel) -> float:
    """What the flight so far takes by the model, and the landing if it has begun.

    Energy goes with time, not with the way: against the wind the same way takes much more.
    """
    still_s = leg.step.length_m / leg.speed_mps
    power_w = leg.flight_j / still_s
    if leg.is_on_the_way(reading):
        return power_w * elapsed_s
    # A landing takes no longer than this: the way has taken the rest.
    way_s = max(min(still_s, elapsed_s), elapsed_s - model.stop_s)
    landing_s = elapsed_s - way_s
    return power_w * way_s + leg.stop_j * min(1.0, landing_s / max(model.stop_s, 1.0))
