"""From the rest of a mission to the steps that its drone is sent."""

from collections.abc import Iterator
from dataclasses import replace

from skyway.contracts.flight_step import FlightStep
from skyway.delivery.plan import PickUp
from skyway.ids import PackageId
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.anchor import Anchor
from skyway_composition.missions.instruct import StepTerms, flight_steps, wait_there
from skyway_composition.missions.proposal import Revision
from skyway_composition.missions.record import MissionRecord, Trouble
from skyway_composition.missions.rest import Rest
from skyway_composition.missions.revision import next_revision
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.planning.trip import PlacedStep


def revision_of(
    record: MissionRecord,
    rest: Rest,
    *,
    anchor: Anchor,
    trouble: Trouble,
    number: int,
    skyway: PreparedNetwork,
    link: DroneLink,
) -> Revision:
    """The mission's revision of this number, with its steps."""
    terms = StepTerms.of(replace(record, aims=rest.aims), skyway.settings)
    if rest.given_up is not None:
        terms = replace(terms, returned=anchor.carried)
    steps: tuple[FlightStep, ...] = flight_steps(
        skyway.network,
        list(_placed(record, rest, anchor, link)),
        terms=terms,
        first_step=anchor.first_step,
    )
    if not steps:
        # Home and charged: the drone still has to hear that nothing is left, to end it.
        start_ms = rest.trip.start_ms
        steps = (wait_there(anchor.station_id, start_ms, step_id=anchor.first_step),)
    mission = next_revision(
        record.mission, rest.trip, revision=number, settings=skyway.settings
    ).model_copy(update={"given_up": rest.given_up})
    if trouble.loaded is not None:
        mission = mission.model_copy(update={"loading": "CONFIRMED"})
    return Revision(mission, steps, rest.aims)


def _placed(
    record: MissionRecord, rest: Rest, anchor: Anchor, link: DroneLink
) -> Iterator[PlacedStep]:
    """The trip's steps; what is on board is picked up only by a drone that has forgotten it."""
    knows_its_load = anchor.carried and not (
        record.stuck is not None and _has_forgotten_its_load(link, anchor.carried)
    )
    for placed in rest.trip.steps():
        if not (knows_its_load and isinstance(placed.step, PickUp)):
            yield placed


def _has_forgotten_its_load(link: DroneLink, carried: frozenset[PackageId]) -> bool:
    """Whether the drone, of whose events none is missing, does not know of anything on board."""
    state = link.state
    if state is None or state.last_event_seq < link.last_event_seq:
        return False
    return carried.isdisjoint(state.package_ids)
