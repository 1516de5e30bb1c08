"""What a drone knows of itself: the sum of its journal's records."""

from pydantic import Field

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    ReturnStep,
)
from skyway.contracts.instruction import CancelInstruction, MissionInstruction
from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DeliveryId, MissionId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.records import (
    AcceptanceTold,
    Answer,
    EventRecorded,
    InstructionAnswered,
    Record,
    StepBegun,
)

#: So many answers are kept for instructions that come again; older ones are surely settled.
ANSWERS_KEPT = 64

#: So many missions that are over are remembered, to refuse late revisions of them.
ENDED_MISSIONS_KEPT = 16


class CurrentMission(WireModel):
    """The accepted mission: the steps that have not ended, and where the drone is in them.

    `expires_at` is the accepted instruction's; `told_at` is when the broker had its ACCEPTED.
    `first_step` is the mission's, not the revision's; `free_at` is when the step before ended;
    `began_at` when the first of `steps` began, or None. After a failure nothing is flown
    until a new revision comes.
    """

    mission_id: MissionId
    revision: int
    delivery_id: DeliveryId
    accepted_by: Answer
    expires_at: FleetMoment
    told_at: FleetMoment | None = None
    first_step: int
    steps: tuple[FlightStep, ...]
    released_through: int
    free_at: FleetMoment
    began_at: FleetMoment | None = None
    has_failed: bool = False


class Logbook(WireModel):
    """Everything a drone must still know after a restart; `station_id` is None in the air."""

    session: int = 0
    stream: int = 0
    last_instruction_seq: int = 0
    answers: tuple[Answer, ...] = ()
    last_event_seq: int = 0
    events: tuple[DroneEvent, ...] = Field(default=(), description="not confirmed by the cloud")
    mission: CurrentMission | None = None
    ended_mission_ids: tuple[MissionId, ...] = ()
    station_id: StationId | None
    position: Position
    soc: Soc
    packages: tuple[PackageOnBoard, ...] = ()

    @property
    def load_kg(self) -> float:
        """The mass of all packages on board."""
        return sum(package.mass_kg for package in self.packages)


def logbook_after(logbook: Logbook, record: Record) -> Logbook:
    """The logbook once this record is written."""
    match record:
        case InstructionAnswered():
            return _answered(logbook, record)
        case AcceptanceTold():
            return _told(logbook, record)
        case StepBegun():
            return _begun(logbook, record)
        case EventRecorded():
            return _happened(logbook, record.event)


def _answered(logbook: Logbook, record: InstructionAnswered) -> Logbook:
    answer, instruction = record.answer, record.instruction
    confirmed_seq = instruction.events_confirmed_seq if instruction else 0
    logbook = logbook.model_copy(
        update={
            "stream": answer.stream,
            "last_instruction_seq": answer.seq,
            "answers": (*logbook.answers, answer)[-ANSWERS_KEPT:],
            "events": tuple(event for event in logbook.events if event.seq > confirmed_seq),
        }
    )
    if answer.status == "REJECTED":
        return logbook
    if isinstance(instruction, MissionInstruction):
        mission = mission_with(logbook, instruction, answer=answer, at=record.answered_at)
        return logbook.model_copy(update={"mission": mission})
    before = logbook.mission
    if isinstance(instruction, CancelInstruction) and before is not None:
        if before.mission_id != instruction.mission_id:
            # A cancel of a mission that the drone does not have changes nothing.
            return logbook
        # What was still on board is stranded: it stays at the station where the drone stands.
        return _without_mission(logbook).model_copy(update={"packages": ()})
    return logbook


def mission_with(
    logbook: Logbook, instruction: MissionInstruction, *, answer: Answer, at: FleetMoment
) -> CurrentMission:
    """The mission once this revision is accepted: what is not replaced is flown before it."""
    before = logbook.mission
    return CurrentMission(
        mission_id=instruction.mission_id,
        revision=instruction.mission_revision,
        delivery_id=instruction.delivery_id,
        accepted_by=answer,
        expires_at=instruction.expires_at,
        first_step=before.first_step if before else instruction.first_step,
        steps=(*steps_kept(before, instruction.first_step), *instruction.steps),
        released_through=before.released_through if before else instruction.first_step - 1,
        free_at=max(at, before.free_at) if before else at,
        began_at=before.began_at if before else None,
    )


def steps_kept(mission: CurrentMission | None, first_step: int) -> tuple[FlightStep, ...]:
    """The steps still to be flown before a revision's first; none after a failure."""
    if mission is None or mission.has_failed:
        return ()
    return tuple(step for step in mission.steps if step.step_id < first_step)


def _told(logbook: Logbook, record: AcceptanceTold) -> Logbook:
    if logbook.mission is None:
        return logbook
    mission = logbook.mission.model_copy(update={"told_at": record.told_at})
    return logbook.model_copy(update={"mission": mission})


def _begun(logbook: Logbook, record: StepBegun) -> Logbook:
    if logbook.mission is None:
        return logbook
    mission = logbook.mission.model_copy(
        update={"began_at": record.started_at, "released_through": record.released_through}
    )
    is_flying = isinstance(mission.steps[0], FlyStep)
    station_id = None if is_flying else logbook.station_id
    return logbook.model_copy(update={"mission": mission, "station_id": station_id})


def _happened(logbook: Logbook, event: DroneEvent) -> Logbook:
    logbook = logbook.model_copy(
        update={"last_event_seq": event.seq, "events": (*logbook.events, event)}
    )
    mission = logbook.mission
    if mission is None:
        return logbook
    if event.event == "MISSION_ENDED":
        return _without_mission(logbook)
    if event.event == "STEP_FAILED":
        failed = mission.model_copy(update={"has_failed": True, "free_at": event.ended_at})
        return logbook.model_copy(update={"mission": failed})
    if event.event == "STEP_ENDED":
        return _step_ended(logbook, mission, event=event)
    return logbook


def _step_ended(logbook: Logbook, mission: CurrentMission, *, event: DroneEvent) -> Logbook:
    step, *remaining = mission.steps
    packages = logbook.packages
    if isinstance(step, PickUpStep):
        packages = (*packages, *step.packages)
    if isinstance(step, DeliverStep | ReturnStep):
        packages = tuple(one for one in packages if one.package_id not in step.package_ids)
    lands = not isinstance(step, FlyStep) or step.lands
    return logbook.model_copy(
        update={
            "mission": mission.model_copy(
                update={"steps": tuple(remaining), "began_at": None, "free_at": event.ended_at}
            ),
            "station_id": event.station_id if lands else None,
            "position": event.position,
            "soc": event.soc,
            "packages": packages,
        }
    )


def _without_mission(logbook: Logbook) -> Logbook:
    if logbook.mission is None:
        return logbook
    ended = (*logbook.ended_mission_ids, logbook.mission.mission_id)[-ENDED_MISSIONS_KEPT:]
    return logbook.model_copy(update={"mission": None, "ended_mission_ids": ended})
