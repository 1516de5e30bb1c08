"""How far a mission is from its plan, and whether that costs a pad, charge or the deadline.

A late drone may also meet a closure that it would have avoided in time.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, RechargeStep
from skyway.contracts.mission import PackageEta
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.replanning.outlook.prediction import Load, PredictedStep, predict
from skyway_composition.missions.replanning.outlook.situation import (
    Situation,
    Whereabouts,
    whereabouts,
)
from skyway_composition.planning.problem_for import used_more, with_margin
from skyway_composition.planning.world import ClosedAhead

#: A smaller delay is not reported to the customer. Our own choice.
REPORTED_LATENESS: Final = timedelta(seconds=60)


#: A smaller shortfall of charge is rounding, or is covered by the margin. Our own choice.
LEAST_SHORTFALL_SOC: Final = 0.001


@dataclass(frozen=True, slots=True)
class Outlook:
    """What to expect of the remaining plan: trouble, and the arrival times of packages.

    `late_by` is the largest delay of a delivery against the arrival times reported before.
    """

    trouble: Trouble | None
    etas: tuple[PackageEta, ...]
    late_by: timedelta


def outlook(
    situation: Situation, *, now_ms: int, closed: ClosedAhead | None = None
) -> Outlook | None:
    """What the drone's last report means for its plan; None before its first report.

    Closures are checked only if `closed` is given.
    """
    where = whereabouts(situation)
    if where is None:
        return None
    record = situation.record
    load = Load(situation.masses_kg, situation.carried)
    for step in situation.planned:
        load = load.after(step) if step.step_id < where.next_step else load
    steps = [each for each in situation.planned if each.step_id >= where.next_step]
    model, more = record.candidate.model, used_more(situation.consumption_factor)
    careful = with_margin(model, max(more, record.mission.margins.energy_margin))
    true = with_margin(model, more) if more else model
    ahead = list(predict(steps, where, model=careful, load=load, now_ms=now_ms))
    likely = list(predict(steps, where, model=true, load=load, now_ms=now_ms))
    reported = {each.package_id: each.eta_at for each in record.mission.packages}
    etas = tuple(_etas(ahead))
    late_by = max(
        (each.eta_at - reported[each.package_id] for each in etas if each.package_id in reported),
        default=timedelta(0),
    )
    trouble = _trouble(record, ahead, likely, where=where)
    if trouble is None and closed is not None:
        trouble = _closed_by_then(ahead, where, closed)
    return Outlook(trouble, etas, late_by)


def _etas(ahead: Sequence[PredictedStep]) -> Iterator[PackageEta]:
    for predicted in ahead:
        if isinstance(predicted.step, DeliverStep):
            eta_at = ms_to_moment(predicted.end_ms)
            for package_id in predicted.step.package_ids:
                yield PackageEta(package_id=package_id, eta_at=eta_at)


def _trouble(
    record: MissionRecord,
    ahead: Sequence[PredictedStep],
    likely: Sequence[PredictedStep],
    *,
    where: Whereabouts,
) -> Trouble | None:
    """The first trouble of the plan, in the order of its steps.

    `ahead` is predicted with the margin on all flights, `likely` without: the margin may cover the
    charge that a tolerated delay costs. A landing under way cannot be changed, so it is no trouble.
    If the drone will arrive at a pad below its reserve, the steps after it are checked later, when
    its charge is reported.
    """
    least_soc = record.candidate.model.reserve_soc - LEAST_SHORTFALL_SOC
    tolerated_s = record.mission.margins.tolerated_lateness_s
    short: PredictedStep | None = None
    soc = where.soc
    for predicted, expected in zip(ahead, likely, strict=True):
        step = predicted.step
        came_with_soc, soc = soc, predicted.soc_end
        if isinstance(step, RechargeStep) and predicted.is_lost:
            return _late(predicted, f"its pad at {step.station_id!r} is lost")
        if isinstance(step, RechargeStep) and came_with_soc < least_soc:
            return None
        if isinstance(step, FlyStep) and step.lands and where.is_doing(step):
            continue
        if predicted.is_short:
            short = predicted
        if isinstance(step, FlyStep) and predicted.soc_end < least_soc:
            if short is not None and _late_by_s(short) > tolerated_s:
                return _late(short, "it cannot charge enough")
            is_late = short is not None and _late_by_s(short) > 0
            if is_late and expected.soc_end >= least_soc:
                continue
            detail = f"charge {predicted.soc_end:.3f} at {step.to_id!r} would be below the reserve"
            return Trouble(code="MORE_ENERGY", detail=detail)
        if _misses_deadline(record, predicted) and _late_by_s(predicted) > tolerated_s:
            return _late(predicted, "the deadline is missed")
    return None


def _late(predicted: PredictedStep, loss: str) -> Trouble:
    return Trouble(code="LATE", detail=f"{_late_by_s(predicted):.0f} s late: {loss}")


def _late_by_s(predicted: PredictedStep) -> float:
    """How much later than planned a step begins."""
    return (predicted.start_ms - moment_to_ms(predicted.step.planned_start_at)) / 1000


def _misses_deadline(record: MissionRecord, predicted: PredictedStep) -> bool:
    """Whether a delivery that was planned before its deadline, or its window's end, is later."""
    step = predicted.step
    if not isinstance(step, DeliverStep):
        return False
    limits = [record.request.qos.deadline_at]
    limits += [each.latest_at for each in record.packages(frozenset(step.package_ids))]
    end_at = ms_to_moment(predicted.end_ms)
    return any(limit is not None and step.planned_end_at <= limit < end_at for limit in limits)


def _closed_by_then(
    ahead: Iterable[PredictedStep], where: Whereabouts, closed: ClosedAhead
) -> Trouble | None:
    """The first flight or hand-over that meets a closure, and would not at its planned time.

    A flight that meets a closure at its planned time was planned so, because no other way was left.
    """
    for predicted in ahead:
        step = predicted.step
        planned = moment_to_ms(step.planned_start_at), moment_to_ms(step.planned_end_at)
        expected = predicted.start_ms, predicted.end_ms
        is_begun = where.is_doing(step)
        is_shut = isinstance(step, PickUpStep | DeliverStep) and (
            _is_shut(step, expected, closed) and not _is_shut(step, planned, closed)
        )
        if is_shut and not is_begun:
            detail = "its station has closed when packages would change hands there"
            return Trouble(code="LATE", detail=detail)
        if not isinstance(step, FlyStep):
            continue
        if _meets(step, expected, closed, is_begun=is_begun) and not _meets(
            step, planned, closed, is_begun=is_begun
        ):
            detail = f"the way to {step.to_id!r} is closed when the drone comes"
            return Trouble(code="LATE", detail=detail)
    return None


def _is_shut(step: PickUpStep | DeliverStep, span_ms: tuple[int, int], closed: ClosedAhead) -> bool:
    """Whether the station is closed by its opening hours at some moment of this act."""
    # A station that closes at the very end of the act is open during the act.
    return any(closed.is_shut(step.station_id, at_ms) for at_ms in (span_ms[0], span_ms[1] - 1))


def _meets(step: FlyStep, span_ms: tuple[int, int], closed: ClosedAhead, *, is_begun: bool) -> bool:
    """Whether a flight meets a closure; of a flight that has begun only the landing counts."""
    start_ms, end_ms = span_ms
    if step.lands and closed.closes_landing(step.to_id, end_ms):
        return True
    if step.lands and not is_begun and closed.is_shut(step.to_id, end_ms):
        return True
    return not is_begun and closed.closes_segment(
        step.from_id, step.to_id, start_ms=start_ms, end_ms=end_ms
    )
