"""The anchor: the earliest place and moment from which the plan of a mission can be changed.

A standing drone can get new steps immediately, except during a hand-over or a loading. A flying
drone has released its steps up to the next landing. They stay as they are, unless one of them leads
to something closed, or the drone must land as soon as it can.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway_composition.missions.mission.record import CALLED_HOME, Stuck, Trouble
from skyway_composition.missions.replanning.prediction import Load, PredictedStep, predict
from skyway_composition.missions.replanning.situation import (
    Situation,
    Whereabouts,
    whereabouts,
)
from skyway_composition.planning.world import ClosedAhead

#: Troubles for which a drone turns at the end of its present flight.
_TURNS_IMMEDIATELY: Final = (CALLED_HOME,)


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where, when and with what charge and load a new plan begins, after `last_valid_step`.

    `is_divert` when the plan replaces released steps or the step under way. `is_in_the_air` when
    the drone cannot land there and only flies over. `at_ms` may be later than the drone's arrival,
    so that the new plan reaches the drone before it begins.
    """

    station_id: StationId
    at_ms: int
    soc: float
    last_valid_step: int
    carried: frozenset[PackageId]
    has_loaded: bool
    is_divert: bool = False
    is_in_the_air: bool = False

    @property
    def first_step(self) -> int:
        """The first step of the new plan."""
        return self.last_valid_step + 1


def anchor_of_stuck(situation: Situation, stuck: Stuck, *, earliest_ms: int) -> Anchor:
    """The anchor of a drone that stands and waits for new steps; it has dropped its old steps."""
    begun = [each.step.step_id for each in situation.steps if each.status != "PLANNED"]
    return Anchor(
        station_id=stuck.station_id,
        at_ms=earliest_ms,
        soc=stuck.soc,
        last_valid_step=max([*begun, stuck.last_step]),
        carried=situation.carried,
        has_loaded=situation.has_loaded,
    )


def find_anchor(
    situation: Situation,
    trouble: Trouble,
    *,
    model: DroneModel,
    closed: ClosedAhead,
    now_ms: int,
    earliest_ms: int,
    before_step: int | None = None,
) -> Anchor | None:
    """The anchor of a drone that flies by its plan; None while it cannot be determined.

    `model` has the margin that flights are planned with; new steps can begin at `earliest_ms`.
    For a drone in flight, `before_step` selects an earlier anchor: the station that the drone flies
    over before it begins that step.
    """
    where = whereabouts(situation)
    if where is None:
        return None
    steps = [each for each in situation.planned if each.step_id >= where.next_step]
    load = Load(situation.masses_kg, situation.carried)
    for step in situation.planned:
        # The drone's state says that this step has ended; its event is still on its way.
        load = load.after(step) if step.step_id < where.next_step else load
    ahead = list(predict(steps, where, model=model, load=load, now_ms=now_ms))
    if where.is_under_way and ahead and isinstance(ahead[0].step, FlyStep):
        left = [each for each in ahead if before_step is None or each.step.step_id < before_step]
        anchor = (
            _anchor_in_flight(left, where, trouble, model=model, closed=closed) if left else None
        )
    elif before_step is not None:
        return None
    elif where.is_under_way and ahead:
        anchor = _anchor_at_stop(situation, ahead[0], where, trouble, now_ms=now_ms)
    else:
        anchor = _anchor_of_standing_drone(where, load)
    if anchor is None:
        return None
    has_loaded = situation.has_loaded or any(
        isinstance(each, PickUpStep) and each.step_id <= anchor.last_valid_step
        for each in situation.planned
    )
    return replace(anchor, at_ms=max(anchor.at_ms, earliest_ms), has_loaded=has_loaded)


def _anchor_in_flight(
    ahead: Sequence[PredictedStep],
    where: Whereabouts,
    trouble: Trouble,
    *,
    model: DroneModel,
    closed: ClosedAhead,
) -> Anchor | None:
    """The anchor of a drone in flight: its landing, or the last station before a closure.

    The present flight continues to its end.
    """
    flights = [each for each in ahead if each.step.step_id <= where.released_through]
    last = flights[-1]
    must_turn = (
        trouble.land_at is not None
        or trouble.code in _TURNS_IMMEDIATELY
        or last.soc_end < model.reserve_soc
    )
    valid = flights[:1] if must_turn else _still_valid(flights, closed)
    end = valid[-1]
    if not isinstance(end.step, FlyStep):
        return None
    is_closed = closed.closes_landing(end.step.to_id, end.end_ms)
    # After a flight without a landing the new plan may still land here: keep time and energy.
    landing_soc = 0.0 if end.step.lands else model.stop_j / model.battery_j
    landing_ms = 0 if end.step.lands else round(model.stop_s * 1000)
    return Anchor(
        station_id=end.step.to_id,
        at_ms=end.end_ms + landing_ms,
        soc=max(0.0, end.soc_end - landing_soc),
        last_valid_step=end.step.step_id,
        carried=end.load.carried,
        has_loaded=True,
        is_divert=is_closed or end.step.step_id < where.released_through,
        is_in_the_air=is_closed,
    )


def _still_valid(flights: Sequence[PredictedStep], closed: ClosedAhead) -> Sequence[PredictedStep]:
    """The flights before the first one that meets a closure; at least one flight."""
    for number, flight in enumerate(flights):
        step = flight.step
        if not isinstance(step, FlyStep):
            continue
        # Only a flight that has not begun can be left out. A landing can become a flight over.
        is_hit = number > 0 and closed.closes_segment(
            step.from_id, step.to_id, start_ms=flight.start_ms, end_ms=flight.end_ms
        )
        if is_hit or (step.lands and closed.closes_landing(step.to_id, flight.end_ms)):
            return flights[: max(1, number)]
    return flights


def _anchor_at_stop(
    situation: Situation,
    under_way: PredictedStep,
    where: Whereabouts,
    trouble: Trouble,
    *,
    now_ms: int,
) -> Anchor | None:
    """The anchor at a stop: after a hand-over or loading; waits and recharges end now."""
    step = under_way.step
    match step:
        case WaitStep() | RechargeStep():
            return _cut(step, _soc_now(step, under_way, where, now_ms=now_ms), situation)
        case PickUpStep():
            requested = {each.package_id for each in situation.record.request.packages}
            if {each.package_id for each in step.packages} - requested:
                return _cut(step, where.soc, situation)
            if situation.record.mission.loading == "AWAITED" and trouble.loaded is None:
                return None
        case _:
            pass
    return _after(under_way)


def _soc_now(
    step: FlightStep, under_way: PredictedStep, where: Whereabouts, *, now_ms: int
) -> float:
    """The charge of a standing drone; while it charges, by linear interpolation."""
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


def _anchor_of_standing_drone(where: Whereabouts, load: Load) -> Anchor | None:
    """The anchor of a drone between two steps, or before the first step."""
    if where.station_id is None:
        return None
    return Anchor(
        station_id=where.station_id,
        at_ms=where.at_ms,
        soc=where.soc,
        last_valid_step=where.next_step - 1,
        carried=load.carried,
        has_loaded=False,
    )
