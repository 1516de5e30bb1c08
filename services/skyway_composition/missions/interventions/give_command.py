"""Carries out what an operator orders the drone of a mission to do, or previews it by a dry run."""

from dataclasses import replace
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from skyway.contracts.drone_report import ActiveFailsafe
from skyway.errors import InvalidInput
from skyway.ids import InstructionId, MissionId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.errors import Conflict
from skyway_composition.context import Context
from skyway_composition.links.instruction_store import kind_of_revision
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.interventions.stop_packages import (
    return_packages,
    stop_packages,
)
from skyway_composition.missions.mission.custody_store import on_board
from skyway_composition.missions.mission.end import abort
from skyway_composition.missions.mission.instruct import held, hold, resume
from skyway_composition.missions.mission.record import CALLED_HOME, DIVERTED, MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, lock_mission
from skyway_composition.missions.replanning.check_plan import request_plan
from skyway_composition.missions.replanning.foresee import Foresight, rehearsed
from skyway_composition.missions.replanning.outlook import MissionOutlook
from skyway_composition.missions.replanning.situation import Situation, steering_failsafe
from skyway_composition.networks.station_store import network_of

CommandName = Literal["HOLD", "RESUME", "DIVERT", "RETURN_HOME", "CANCEL", "GIVE_UP"]

#: The code in reports about packages that an operator has cancelled.
_CANCELLED_BY_OPERATOR: Final = "CANCELLED_BY_OPERATOR"


class Command(JsonModel):
    """A command for the drone of a mission; `station_id` says where a DIVERT lands.

    A DIVERT or RETURN_HOME may override an active failsafe, and its faults for the remainder of
    the mission. It never overrides an emergency landing that was ordered because no station can be
    reached.

    GIVE_UP ends a mission in doubt. Packages that were not loaded may then be flown by another
    drone, so an operator gives this command only after people have found out where they are.
    """

    command: Annotated[
        CommandName,
        Field(
            description="HOLD, RESUME, DIVERT to a station, RETURN_HOME, CANCEL, or GIVE_UP a "
            "mission in doubt: people know that its drone has not delivered, and will not.",
            examples=["HOLD"],
        ),
    ]
    station_id: Annotated[
        StationId | None, Field(description="Station where a DIVERT lands; only for DIVERT.")
    ] = None
    reason: Annotated[
        str,
        Field(
            min_length=1,
            max_length=500,
            description="Why the operator gives the command, for reports and the drone's log.",
            examples=["crowd at the station"],
        ),
    ]
    overrides_failsafe: Annotated[
        bool,
        Field(description="Whether a DIVERT or RETURN_HOME overrides an active failsafe."),
    ] = False

    @model_validator(mode="after")
    def _says_where(self) -> Self:
        if (self.command == "DIVERT") != (self.station_id is not None):
            raise ValueError("DIVERT names a station_id, and no other command does")
        if self.overrides_failsafe and self.command not in ("DIVERT", "RETURN_HOME"):
            raise ValueError("only DIVERT and RETURN_HOME may have overrides_failsafe")
        return self


class CommandAnswer(JsonModel):
    """The accepted command; without `instruction_id` the drone gets it with its next plan.

    That plan waits until the failsafe in `waits_for` is over.
    """

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    command: Annotated[CommandName, Field(description="The accepted command.")]
    instruction_id: Annotated[
        InstructionId | None,
        Field(description="Id of the instruction to the drone; null until a plan is made."),
    ] = None
    waits_for: Annotated[
        ActiveFailsafe | None,
        Field(description="Active failsafe that delays the command; null if nothing delays it."),
    ] = None


async def give_command(context: Context, mission_id: MissionId, command: Command) -> CommandAnswer:
    """Do immediately what can be done, and have the remainder planned; wakes `stuck`.

    Raises
    ------
    NotFound
        There is no such mission.
    Conflict
        MISSION_OVER, ALREADY_HELD, NOT_HELD, BEING_LOADED, NOTHING_ON_BOARD, TOO_LATE,
        ALREADY_CALLED_HOME, NOT_IN_DOUBT.
    InvalidInput
        The station is not in the mission's network.
    """
    async with context.db.write() as tx:
        work, record = await lock_mission(context, tx, mission_id, provider_id=None)
        instruction_id = await carry_out(work, record, command)
        tx.after_commit(context.stuck.set)
    return CommandAnswer(
        mission_id=mission_id,
        command=command.command,
        instruction_id=instruction_id,
        waits_for=obstacle(command, record, work.links[record.drone_id]),
    )


def obstacle(command: Command, record: MissionRecord, link: DroneLink) -> ActiveFailsafe | None:
    """The active failsafe that delays this command; None when nothing delays it."""
    brings_steps = command.command in ("DIVERT", "RETURN_HOME", "CANCEL")
    if command.overrides_failsafe or not brings_steps:
        return None
    return steering_failsafe(record, link.state)


async def carry_out(
    work: MissionUnitOfWork, record: MissionRecord, command: Command
) -> InstructionId | None:
    """Do in this transaction what a command orders; returns the instruction sent immediately.

    Raises
    ------
    Conflict, InvalidInput
        As `give_command`.
    """
    reason = command.reason
    match command.command:
        case "HOLD":
            return await _hold(work, record, reason)
        case "RESUME":
            return await _resume(work, record, reason)
        case "RETURN_HOME":
            await _return_home(work, record, command)
        case "CANCEL":
            await _cancel(work, record, reason)
        case "GIVE_UP":
            await _give_up(work, record, reason)
        case "DIVERT":
            return await _divert(work, record, command)
    return None


async def _hold(work: MissionUnitOfWork, record: MissionRecord, reason: str) -> InstructionId:
    if record.mission.is_held:
        raise Conflict("ALREADY_HELD", f"{record.mission_id} is held")
    _refuse_while_loaded(record)
    await work.save(held(record, is_held=True))
    return await hold(work, record, reason=reason)


async def _resume(work: MissionUnitOfWork, record: MissionRecord, reason: str) -> InstructionId:
    """Continue by a new plan, because the old times are over; drop a diversion not yet flown."""
    if not record.mission.is_held:
        raise Conflict("NOT_HELD", f"{record.mission_id} is not held")
    record = held(record, is_held=False)
    if record.trouble is not None and record.trouble.land_at is not None:
        record = replace(record, trouble=None)
    await work.save(record)
    instruction_id = await resume(work, record)
    await request_plan(work, record, Trouble(code="HELD_UP", detail=f"resumed: {reason}"))
    return instruction_id


async def _divert(
    work: MissionUnitOfWork, record: MissionRecord, command: Command
) -> InstructionId:
    """Hold immediately, in case no way is found; the diversion ends with a wait for a command."""
    station_id, reason = command.station_id, command.reason
    is_in_network = (
        station_id is not None
        and await network_of(work.tx.connection, station_id) == record.network_id
    )
    if not is_in_network:
        detail = f"{station_id!r} is not a station of network {record.network_id}"
        raise InvalidInput("station_id", detail)
    _refuse_while_loaded(record)
    record = held(record, is_held=True)
    await work.save(record)
    instruction_id = await hold(work, record, reason=reason)
    trouble = Trouble(
        code=DIVERTED,
        detail=reason,
        land_at=station_id,
        overrides_failsafe=command.overrides_failsafe,
    )
    await request_plan(work, record, trouble)
    return instruction_id


async def _return_home(work: MissionUnitOfWork, record: MissionRecord, command: Command) -> None:
    """Bring back the packages on board; an empty drone flies home anyway, or is cancelled."""
    carried = on_board(await work.custody.held_on(record))
    own = [each.package_id for each in record.packages(carried)]
    if not own:
        detail = f"nothing of {record.mission_id} is on board: to end it before loading, cancel it"
        raise Conflict("NOTHING_ON_BOARD", detail)
    if record.mission.is_held:
        raise Conflict("HELD", f"{record.mission_id} is held: resume it first")
    if not command.overrides_failsafe and await _is_called_home(work, record):
        raise Conflict("ALREADY_CALLED_HOME", f"{record.mission_id} is on its way home")
    overrides = command.overrides_failsafe
    why = Trouble(code=CALLED_HOME, detail=command.reason, overrides_failsafe=overrides)
    await return_packages(work, record, own, why)


async def _is_called_home(work: MissionUnitOfWork, record: MissionRecord) -> bool:
    """Whether the mission flies home, has a proposal to fly home, or waits for such a plan."""
    mission, proposal, trouble = record.mission, record.proposal, record.trouble
    if CALLED_HOME in (proposal and proposal.code, trouble and trouble.code):
        return True
    kind = await kind_of_revision(work.tx, mission.mission_id, mission.revision)
    return kind == "RETURN_HOME" and proposal is None and trouble is None


async def _cancel(work: MissionUnitOfWork, record: MissionRecord, reason: str) -> None:
    """Cancel all packages of the mission."""
    package_ids = [each.package_id for each in record.request.packages]
    why = Trouble(code=_CANCELLED_BY_OPERATOR, detail=reason)
    stopped = await stop_packages(work, record, package_ids, why)
    if not stopped.released and not stopped.returning:
        detail = f"everything that {record.mission_id} carries is handed over or on its way"
        raise Conflict("TOO_LATE", detail)


async def _give_up(work: MissionUnitOfWork, record: MissionRecord, reason: str) -> None:
    """End a mission in doubt. If its drone comes back with the mission, it gets a CANCEL then."""
    doubt = record.mission.doubt
    if doubt is None:
        detail = f"{record.mission_id} is not in doubt: cancel it, or wait for its drone"
        raise Conflict("NOT_IN_DOUBT", detail)
    why = Trouble(code=doubt.code, detail=f"{reason} ({doubt.detail})")
    await abort(work, record, why, at=work.clock.now())


def _refuse_while_loaded(record: MissionRecord) -> None:
    """Refuse while a confirmed loading is on its way: the drone must not get two instructions."""
    if record.is_being_loaded:
        raise Conflict("BEING_LOADED", f"the loading of {record.mission_id} was just confirmed")


class CommandPreview(JsonModel):
    """What a command would do to a mission, by a dry run."""

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    command: Annotated[CommandName, Field(description="The previewed command.")]
    waits_for: Annotated[
        ActiveFailsafe | None,
        Field(description="Active failsafe that would delay it; null if nothing delays it."),
    ]
    outlook: Annotated[
        MissionOutlook, Field(description="What the mission would do after the command.")
    ]


async def preview_command(
    context: Context, foresight: Foresight, mission_id: MissionId, command: Command
) -> CommandPreview:
    """Carry the command out in a transaction that is rolled back, and plan what follows.

    Raises
    ------
    NotFound, Conflict, InvalidInput
        The error with which the command would be refused.
    """
    async with context.db.rehearse() as tx:
        work, record = await lock_mission(context, tx, mission_id, provider_id=None)
        before = await Situation.of(work, record)
        await carry_out(work, record, command)
        seen = await rehearsed(work, before)
    return CommandPreview(
        mission_id=mission_id,
        command=command.command,
        waits_for=obstacle(command, record, before.link),
        outlook=await foresight.outlook(seen),
    )
