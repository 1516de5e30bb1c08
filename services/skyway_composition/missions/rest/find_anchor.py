"""Finds the anchor of a mission, whatever its drone is at."""

from dataclasses import replace

from skyway.contracts.flight_step import FlyStep, PickUpStep
from skyway.drone.model import DroneModel
from skyway_composition.missions.outlook.prediction import Load, predict
from skyway_composition.missions.outlook.situation import Situation
from skyway_composition.missions.outlook.whereabouts import Whereabouts, whereabouts
from skyway_composition.missions.record import Stuck, Trouble
from skyway_composition.missions.rest.anchor import Anchor
from skyway_composition.missions.rest.anchor_at_stop import anchor_at_stop
from skyway_composition.missions.rest.anchor_in_flight import anchor_in_flight
from skyway_composition.missions.rest.closed_ahead import ClosedAhead


def anchor_of_stuck(situation: Situation, stuck: Stuck, *, earliest_ms: int) -> Anchor:
    """Where a drone stands that waits for new steps; it has forgotten all old ones."""
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
    """The anchor of a drone that flies by its plan; None while none can be known.

    `model` has the margin that flights are planned with; new steps can begin at `earliest_ms`.
    Of a drone in flight, `before_step` asks for an earlier one: where it would fly over before it
    begins that step.
    """
    where = whereabouts(situation)
    if where is None:
        return None
    steps = [each for each in situation.planned if each.step_id >= where.next_step]
    load = Load(situation.masses_kg, situation.carried)
    for step in situation.planned:
        # Ended already, as the drone's state says, though the events are still on their way.
        load = load.after(step) if step.step_id < where.next_step else load
    ahead = list(predict(steps, where, model=model, load=load, now_ms=now_ms))
    if where.is_under_way and ahead and isinstance(ahead[0].step, FlyStep):
        left = [each for each in ahead if before_step is None or each.step.step_id < before_step]
        anchor = (
            anchor_in_flight(left, where, trouble, model=model, closed=closed) if left else None
        )
    elif before_step is not None:
        return None
    elif where.is_under_way and ahead:
        anchor = anchor_at_stop(situation, ahead[0], where, trouble, now_ms=now_ms)
    else:
        anchor = _of_standing(where, load)
    if anchor is None:
        return None
    has_loaded = situation.has_loaded or any(
        isinstance(each, PickUpStep) and each.step_id <= anchor.last_valid_step
        for each in situation.planned
    )
    return replace(anchor, at_ms=max(anchor.at_ms, earliest_ms), has_loaded=has_loaded)


def _of_standing(where: Whereabouts, load: Load) -> Anchor | None:
    """Between two steps, or before the first."""
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
