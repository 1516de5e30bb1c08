"""The anchor of a drone that is at something where it stands: a hand-over, a wait, a recharge."""

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway_composition.missions.outlook.prediction import PredictedStep
from skyway_composition.missions.outlook.situation import Situation
from skyway_composition.missions.outlook.whereabouts import Whereabouts
from skyway_composition.missions.record import Trouble
from skyway_composition.missions.rest.anchor import Anchor


def anchor_at_stop(
    situation: Situation,
    under_way: PredictedStep,
    where: Whereabouts,
    trouble: Trouble,
    *,
    now_ms: int,
) -> Anchor | None:
    """After a hand-over or a loading; a wait or a recharge ends at once."""
    step = under_way.step
    match step:
        case WaitStep() | RechargeStep():
            return _cut(step, _soc_now(step, under_way, where, now_ms=now_ms), situation)
        case PickUpStep():
            wanted = {each.package_id for each in situation.record.request.packages}
            if {each.package_id for each in step.packages} - wanted:
                return _cut(step, where.soc, situation)
            if situation.record.mission.loading == "AWAITED" and trouble.loaded is None:
                return None
        case _:
            pass
    return _after(under_way)


def _soc_now(
    step: FlightStep, under_way: PredictedStep, where: Whereabouts, *, now_ms: int
) -> float:
    """The charge of a drone that stands, and may be charging: straight between two moments."""
    if not isinstance(step, RechargeStep) or under_way.end_ms <= where.at_ms:
        return where.soc
    share = (min(now_ms, under_way.end_ms) - where.at_ms) / (under_way.end_ms - where.at_ms)
    # The charge curve is concave, so the drone has at least this.
    return where.soc + max(0.0, share) * (under_way.soc_end - where.soc)


def _cut(step: FlightStep, soc: float, situation: Situation) -> Anchor | None:
    if isinstance(step, FlyStep):
        return None
    return Anchor(
        station_id=step.station_id,
        at_ms=0,
        soc=soc,
        last_valid_step=step.step_id - 1,
        carried=situation.carried,
        has_loaded=situation.has_loaded,
        is_divert=True,
    )


def _after(under_way: PredictedStep) -> Anchor | None:
    step = under_way.step
    if not isinstance(step, PickUpStep | DeliverStep | ReturnStep):
        return None
    return Anchor(
        station_id=step.station_id,
        at_ms=under_way.end_ms,
        soc=under_way.soc_end,
        last_valid_step=step.step_id,
        carried=under_way.load.carried,
        has_loaded=True,
    )
