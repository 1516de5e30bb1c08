"""Checks the plan of a mission after each event or state, and requests another if it fails.

The plan no longer holds if the mission is so far from the plan that this costs a pad, charge or the
deadline. A late drone may also meet a closure that it would have avoided on time.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, RechargeStep
from skyway.contracts.mission import PackageEta
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.margins import REPORT_ARRIVES
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.store import save_troubles
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.felt_wind import air_ahead, first_flights
from skyway_composition.missions.replanning.prediction import Load, PredictedStep, predict
from skyway_composition.missions.replanning.situation import (
    Situation,
    Whereabouts,
    factor_beyond,
    waits_for_pad,
    whereabouts,
)
from skyway_composition.missions.replanning.store import plan_now
from skyway_composition.planning.problem_for import used_more, with_margin
from skyway_composition.planning.world import ClosedAhead


async def request_plan(
    work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble
) -> MissionRecord:
    """Save why a mission needs another plan; the replanner finds the mission once woken.

    The first trouble is reported, later troubles are not. The caller wakes `stuck` after the
    commit.
    """
    record = _with_trouble(work, record, trouble)
    await work.save(record)
    await plan_now(work.tx, record.mission_id)
    return record


async def request_plans(
    work: MissionUnitOfWork, records: Iterable[MissionRecord], trouble: Trouble
) -> None:
    """Request plans for many missions in one statement: a closure may hit hundreds of them."""
    changed = [_with_trouble(work, each, trouble) for each in records]
    await save_troubles(work.tx, changed)
    await work.change_calendars([each.drone_id for each in changed])
    work.missions.update({record.drone_id: record for record in changed})


def _with_trouble(
    work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble
) -> MissionRecord:
    """The record with this trouble, which is reported if it is the first.

    A mission in doubt is not planned before the doubt ends, so that is not reported.
    """
    if record.trouble is None and record.stuck is None and record.mission.doubt is None:
        record = report(work, record, "REPLANNING", code=trouble.code, detail=trouble.detail)
    return replace(record, trouble=_merged(record.trouble, trouble))


def _merged(earlier: Trouble | None, new: Trouble) -> Trouble:
    """The new trouble, with the loading or diversion that people asked for in the earlier one.

    The earlier trouble alone is not enough: it ends when the plan made for it is accepted, and
    that plan may be on its way already.
    """
    if earlier is None or new.loaded is not None or new.land_at is not None:
        return new
    if earlier.loaded is None and earlier.land_at is None:
        return new
    return new.model_copy(
        update={
            "loaded": earlier.loaded,
            "land_at": earlier.land_at,
            "overrides_failsafe": earlier.overrides_failsafe,
        }
    )


#: A smaller delay is not reported to the customer. Our own choice.
_REPORTED_LATENESS: Final = timedelta(seconds=60)

#: A smaller shortfall of charge is rounding, or is covered by the margin. Our own choice.
_LEAST_SHORTFALL_SOC: Final = 0.001

#: The share of the planned margin that the rest of a plan must still have. If the whole margin had
#: to be left, each gust would cause a new plan. Our own choice.
_MARGIN_LEFT: Final = 2 / 3


@dataclass(frozen=True, slots=True)
class _Outlook:
    """A forecast of the remaining plan: trouble, and the arrival times of packages.

    `late_by` is the largest delay of a delivery against the arrival times reported before.
    """

    trouble: Trouble | None
    etas: tuple[PackageEta, ...]
    late_by: timedelta


async def check_plan(
    work: MissionUnitOfWork, record: MissionRecord, closed: ClosedAhead | None = None
) -> MissionRecord:
    """Request another plan if the present one leads to trouble; returns the saved record.

    Plans avoid what is `closed`; only a late drone may meet it.
    """
    seen = await _outlook(work, record, closed)
    if seen is None or seen.trouble is None:
        return record
    return await request_plan(work, record, seen.trouble)


async def check_plan_after_step(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> MissionRecord:
    """Check the plan after a step has ended; without trouble, report a delay to the customer."""
    seen = await _outlook(work, record)
    if seen is None:
        return record
    if seen.trouble is not None:
        return await request_plan(work, record, _explained(seen.trouble, event))
    if seen.late_by < _REPORTED_LATENESS:
        return record
    record = report(
        work,
        record,
        "ACTIVITY",
        at=event.ended_at,
        station_id=event.station_id,
        soc=event.soc,
        etas=seen.etas,
        data={"late_by_s": seen.late_by.total_seconds()},
    )
    await work.save(record)
    return record


def _explained(trouble: Trouble, event: DroneEvent) -> Trouble:
    """The trouble with its cause, if the event has just reported the cause."""
    if event.code != "SHORT_CHARGE" or trouble.code != "MORE_ENERGY":
        return trouble
    detail = f"charged to {event.soc:.3f} only before the session at {event.station_id!r} ended"
    return Trouble(code="SHORT_CHARGE", detail=f"{detail}: {trouble.detail}")


async def _outlook(
    work: MissionUnitOfWork, record: MissionRecord, closed: ClosedAhead | None = None
) -> _Outlook | None:
    """The forecast of the plan.

    None if another plan is needed already, if the mission is held, in doubt or waits, or without a
    report.
    """
    mission = record.mission
    needs_no_check = record.trouble or record.stuck or record.proposal or mission.is_held
    if waits_for_pad(record, work.links[record.drone_id]):
        # The drone itself requests another plan. A plan with the same pad would make it wait again.
        return None
    # The time that a loader takes is not planned: the plan is made again after the confirmation.
    is_waiting = mission.state == "BOOKED" or mission.loading == "AWAITED"
    # What a drone in doubt does is unknown: to say that its mission is replanned would be false.
    if needs_no_check or is_waiting or mission.doubt is not None or not record.is_live:
        return None
    if _is_as_booked(record, work.links[record.drone_id].state, now=work.clock.now()):
        return None
    situation = await Situation.of(work, record)
    # Reports about the last seconds may be on their way: the drone may be further than reported.
    reported_until = work.clock.now() - REPORT_ARRIVES.span(work.clock)
    return _expected(situation, now_ms=moment_to_ms(reported_until), closed=closed)


def _is_as_booked(record: MissionRecord, state: DroneState | None, *, now: datetime) -> bool:
    """Whether a drone is as ready as when its first plan was made, so that the plan holds."""
    mission, drone = record.mission, record.candidate
    is_to_begin = (mission.state, mission.revision) == ("ACCEPTED", 1) and now <= mission.start_at
    # A loader's confirmation or a cancellation changes what the drone was booked for.
    is_changed = mission.loading != "AUTOMATIC" or record.aims
    if state is None or state.mission_id != mission.mission_id or not is_to_begin or is_changed:
        return False
    in_air = air_ahead(first_flights(mission.plan.steps, drone.model))
    factor = factor_beyond(record, state, in_air=in_air)
    return (
        (state.activity, state.station_id) == ("IDLE", drone.station_id)
        and state.at <= mission.start_at
        and state.soc >= drone.soc - _LEAST_SHORTFALL_SOC
        and used_more(factor) <= mission.margins.energy_margin
    )


def _expected(
    situation: Situation, *, now_ms: int, closed: ClosedAhead | None = None
) -> _Outlook | None:
    """What the drone's last report means for its plan; None before its first report."""
    where = whereabouts(situation)
    if where is None:
        return None
    record = situation.record
    load = Load(situation.masses_kg, situation.carried)
    for step in situation.planned:
        load = load.after(step) if step.step_id < where.next_step else load
    steps = [each for each in situation.planned if each.step_id >= where.next_step]
    # After a recharge the wind may have changed, and the drone reports its energy use again.
    more, lasting = used_more(situation.consumption_factor), used_more(situation.lasting_factor)

    def predicted(margin: float) -> list[PredictedStep]:
        uses = (max(margin, more), max(margin, min(more, lasting)))
        soon, later = (with_margin(situation.model, each) for each in uses)
        return list(predict(steps, where, model=soon, later=later, load=load, now_ms=now_ms))

    ahead = predicted(_MARGIN_LEFT * record.mission.margins.energy_margin)
    likely = predicted(0.0)
    reported = {each.package_id: each.eta_at for each in record.mission.packages}
    etas = tuple(_etas(ahead))
    known = [each for each in etas if each.package_id in reported]
    late_by = max((each.eta_at - reported[each.package_id] for each in known), default=timedelta(0))
    trouble = _trouble(record, ahead, likely, where=where)
    if trouble is None and closed is not None:
        trouble = _closed_by_then(ahead, where, closed.for_model(record.candidate.model))
    return _Outlook(trouble, etas, late_by)


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
    its charge is reported. A drone in flight also gets no new plan for a flight after its next
    charging session: the gusts may be over by then, and on the pad it can charge longer.
    """
    least_soc = record.candidate.model.reserve_soc - _LEAST_SHORTFALL_SOC
    tolerated_s = record.mission.margins.tolerated_lateness_s
    short: PredictedStep | None = None
    is_flying = bool(ahead) and isinstance(ahead[0].step, FlyStep) and where.is_under_way
    charges_first, soc = False, where.soc
    for predicted, expected in zip(ahead, likely, strict=True):
        step = predicted.step
        came_with_soc, soc = soc, predicted.soc_end
        if isinstance(step, RechargeStep) and predicted.is_lost:
            return _late(predicted, f"its pad at {step.station_id!r} is lost")
        if isinstance(step, RechargeStep) and came_with_soc < least_soc:
            return None
        charges_first |= isinstance(step, RechargeStep)
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
            if is_flying and charges_first:
                return None
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

    A flight that meets a closure at its planned time was planned so, because there was no other
    way.
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
