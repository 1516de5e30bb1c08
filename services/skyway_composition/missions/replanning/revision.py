"""From the planned remainder of a mission to the revision that its drone is sent."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import FlightStep, FlyStep, WaitStep
from skyway.delivery.plan import PickUp
from skyway.ids import PackageId
from skyway.scheduling.trip import PlacedStep
from skyway.units import ms_to_moment
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.from_trip import (
    StepTerms,
    finished_wait,
    flight_steps,
    next_revision,
)
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.replanning.propose import Revision
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder
from skyway_composition.planning.problem_for import margins_of
from skyway_composition.planning.world import World

#: A diverted drone without any further command ends its mission after this time. Our own choice.
_LONGEST_WAIT: Final = timedelta(days=7)


def revision_of(
    record: MissionRecord,
    remainder: Remainder,
    *,
    anchor: Anchor,
    trouble: Trouble,
    number: int,
    energy_margin: float,
    world: World,
    link: DroneLink,
) -> Revision:
    """The mission's next revision with its steps, under this number and energy margin."""
    skyway = world.skyway
    terms = StepTerms.of(replace(record, aims=remainder.aims), skyway.settings)
    if remainder.given_up is not None:
        terms = replace(terms, returned=anchor.carried)
    steps: tuple[FlightStep, ...] = flight_steps(
        skyway.network,
        list(_placed(record, remainder, anchor, link)),
        terms=terms,
        first_step=anchor.first_step,
    )
    if trouble.land_at is not None:
        steps = (*steps, _wait_for_operator(steps, anchor=anchor))
    elif not steps:
        # The drone is home and charged. It needs one last step to end the mission.
        start_ms = remainder.trip.start_ms
        steps = (finished_wait(anchor.station_id, start_ms, step_id=anchor.first_step),)
    margins = margins_of(
        world.for_drone(record.candidate.learned),
        record.candidate.model,
        remainder.trip.plan,
        start_ms=remainder.trip.start_ms,
        energy_margin=energy_margin,
    )
    mission = next_revision(
        record.mission,
        remainder.trip,
        revision=number,
        margins=margins,
        weather=world.weather_note(remainder.trip.start_ms),
    ).model_copy(update={"given_up": remainder.given_up})
    if remainder.given_up is not None:
        # Packages that are left behind do not arrive, so they have no arrival time.
        arriving = [each for each in mission.packages if each.package_id not in anchor.carried]
        mission = mission.model_copy(update={"packages": tuple(arriving)})
    if trouble.loaded is not None:
        mission = mission.model_copy(update={"loading": "CONFIRMED"})
    return Revision(mission, steps, remainder.aims)


def _wait_for_operator(steps: tuple[FlightStep, ...], *, anchor: Anchor) -> WaitStep:
    """A wait that an operator's command ends; a hold would keep the drone from flying there."""
    station_id = anchor.station_id
    if steps:
        last = steps[-1]
        station_id = last.to_id if isinstance(last, FlyStep) else last.station_id
    start_at = steps[-1].planned_end_at if steps else ms_to_moment(anchor.at_ms)
    return WaitStep(
        step_id=anchor.first_step + len(steps),
        planned_start_at=start_at,
        planned_end_at=start_at + _LONGEST_WAIT,
        station_id=station_id,
        until_at=start_at + _LONGEST_WAIT,
    )


def _placed(
    record: MissionRecord, remainder: Remainder, anchor: Anchor, link: DroneLink
) -> Iterator[PlacedStep]:
    """The trip's steps; a PICK_UP of the load on board only for a drone that has forgotten it."""
    knows_its_load = anchor.carried and not (
        record.stuck is not None and _has_forgotten_its_load(link, anchor.carried)
    )
    for placed in remainder.trip.steps():
        if not (knows_its_load and isinstance(placed.step, PickUp)):
            yield placed


def _has_forgotten_its_load(link: DroneLink, carried: frozenset[PackageId]) -> bool:
    """Whether the drone wrongly reports an empty load, and none of its events is missing."""
    state = link.state
    if state is None or state.last_event_seq < link.last_event_seq:
        return False
    return carried.isdisjoint(state.package_ids)
