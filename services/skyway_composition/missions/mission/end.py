"""Ends missions: the drone and the pads become free in the same transaction (I3).

A mission is put in doubt when it is unknown what its drone has done. It keeps its drone, its pads
and its packages. So no second drone gets the packages while the first drone may have them, or may
have delivered them.
"""

from dataclasses import replace
from datetime import datetime
from typing import Any, Final, Literal

from skyway.contracts.mission import Doubt, MissionState
from skyway.geo import Position
from skyway.ids import PackageId, StationId
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.custody_store import (
    Custodian,
    Held,
    left_behind,
    on_board,
)
from skyway_composition.missions.mission.instruct import call_off
from skyway_composition.missions.mission.record import MissionRecord, Trouble, moved
from skyway_composition.missions.mission.standby import begin_sooner, restore_pads, restore_standby
from skyway_composition.missions.mission.step_store import flown_totals
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm, report
from skyway_composition.pads.store import free
from skyway_composition.planning.no_show_store import note_absence


async def refuse(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """End a mission that its drone has refused or did not answer."""
    is_queued = record.mission.state == "QUEUED"
    record = replace(moved(record, "REFUSED"), stuck=None, trouble=None, proposal=None)
    await free(work.tx, record.mission_id)
    if is_queued:
        await restore_pads(work.tx, record.drone_id)
    await note_absence(work.tx, record.mission, code=why.code, at_ms=moment_to_ms(work.clock.now()))
    record = report(work, record, "REFUSED", code=why.code, detail=why.detail)
    await work.save(record)
    if is_queued:
        await restore_standby(work, record)
    else:
        await begin_sooner(work, record.drone_id)


async def complete(work: MissionUnitOfWork, record: MissionRecord, *, at: datetime) -> None:
    """End a mission whose packages are all delivered or returned, and whose drone is home."""
    await _end(work, record, "COMPLETED", None, at=at)


async def cancel(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """End a mission that has nothing on board, and instruct its drone to cancel it.

    A drone that has started the mission refuses to cancel, flies it to its end, and stays busy
    until then. `request_call_off` waits for the drone's answer instead.
    """
    await call_off(work, record, reason=f"{why.code}: {why.detail}")
    await end_cancelled(work, record, why)


async def cancel_queued(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """End a QUEUED mission; its drone was never instructed."""
    await free(work.tx, record.mission_id)
    await restore_pads(work.tx, record.drone_id)
    await end_cancelled(work, record, why)
    await restore_standby(work, record)


async def end_cancelled(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """End a mission that has nothing on board, and that its drone will not fly."""
    await _end(work, record, "CANCELLED", why, at=work.clock.now())


async def abort(
    work: MissionUnitOfWork,
    record: MissionRecord,
    why: Trouble,
    *,
    at: datetime,
    station_id: StationId | None = None,
) -> None:
    """End a mission that cannot continue; packages on board are stranded where the drone stands.

    `station_id` is given when the drone has just reported where it stands. A drone that waits for
    a revision is instructed to cancel the mission, so that it can serve again.
    """
    if record.mission.state == "BOOKED":
        await refuse(work, record, why)
        return
    if station_id is None and record.stuck is not None:
        station_id = record.stuck.station_id
    link = work.links.get(record.drone_id)
    if station_id is None and link is not None and link.state is not None:
        station_id = link.state.station_id
    if record.stuck is not None:
        await call_off(work, record, reason=f"given up: {why.code}")
    await note_absence(work.tx, record.mission, code=why.code, at_ms=moment_to_ms(work.clock.now()))
    await _end(work, record, "ABORTED", why, at=at, station_id=station_id)


async def end_after_forced_landing(
    work: MissionUnitOfWork,
    record: MissionRecord,
    why: Trouble,
    *,
    at: datetime,
    position: Position,
    soc: float,
) -> None:
    """A drone has landed away from every station: raise an alarm and end its mission.

    Its packages stay on board; people must fetch the drone.
    """
    held = record.own(await work.custody.held_on(record))
    packages = sorted(on_board(held))
    place = f"{position.latitude_deg:.5f}, {position.longitude_deg:.5f}"
    load = f"with {', '.join(packages)} on board" if packages else "with nothing on board"
    await raise_alarm(
        work,
        record,
        level="CRITICAL",
        code="FORCED_LANDING",
        detail=f"down away from every station at {place}, {load}: {why.detail}",
        data={
            "fault": why.code,
            "longitude_deg": position.longitude_deg,
            "latitude_deg": position.latitude_deg,
            "soc": soc,
            "package_ids": packages,
        },
    )
    detail = f"the drone had to land at {place}, away from every station: {why.detail}"
    down = Trouble(code=why.code, detail=detail)
    await _end(work, record, "ABORTED", down, at=at, position=position)


async def _end(
    work: MissionUnitOfWork,
    record: MissionRecord,
    state: MissionState,
    why: Trouble | None,
    *,
    at: datetime,
    station_id: StationId | None = None,
    position: Position | None = None,
) -> None:
    stranded = await _strand(work, record, at=at, station_id=station_id)
    record = replace(moved(record, state), stuck=None, trouble=None, proposal=None)
    await free(work.tx, record.mission_id)
    events = await work.steps.ended_events(record.mission_id)
    record = report(
        work,
        record,
        "ENDED",
        at=at,
        code=why and why.code,
        detail=why and why.detail,
        station_id=station_id,
        position=position,
        stranded_package_ids=stranded,
        data={"flown": flown_totals(events)},
    )
    await work.save(record)
    await begin_sooner(work, record.drone_id)


async def _strand(
    work: MissionUnitOfWork, record: MissionRecord, *, at: datetime, station_id: StationId | None
) -> tuple[PackageId, ...]:
    """The packages that stay on board or were left behind; the station takes custody if known."""
    held = record.own(await work.custody.held_on(record))
    on_its_board = sorted(on_board(held))
    if station_id is not None:
        station = Custodian("STATION", station_id)
        rows = [Held(each, held[each].seq + 1, station) for each in on_its_board]
        await work.custody.add(record, rows, at_ms=moment_to_ms(at))
    return (*on_its_board, *sorted(left_behind(held, record.request.pickup.station_id)))


#: A doubt is replaced only by one with a larger number.
_WEIGHTS: Final = {"NO_ANSWER": 0, "SILENT": 0, "JOURNAL_LOST": 1, "IMPLAUSIBLE": 2}

#: What the mission waits for: after plausible reports, and after impossible reports.
_WAITS: Final = (
    "the mission waits until the drone reports or an operator gives it up",
    "the mission waits until an operator gives it up; reports of the drone change nothing",
)


def is_disbelieved(record: MissionRecord) -> bool:
    """Whether the drone has reported what cannot have happened."""
    doubt = record.mission.doubt
    return doubt is not None and doubt.code == "IMPLAUSIBLE"


async def put_in_doubt(
    work: MissionUnitOfWork,
    record: MissionRecord,
    *,
    code: Literal["NO_ANSWER", "SILENT", "JOURNAL_LOST", "IMPLAUSIBLE"],
    detail: str,
    data: dict[str, Any] | None = None,
) -> MissionRecord:
    """The record in doubt, saved; operators get an alarm, with `data`, and the customer a report.

    The first reason stays, unless the new reason says more: with JOURNAL_LOST the drone itself does
    not know what it did before, and with IMPLAUSIBLE its reports cannot be true.
    """
    earlier = record.mission.doubt
    if earlier is not None and _WEIGHTS[earlier.code] >= _WEIGHTS[code]:
        return record
    now = work.clock.now()
    doubt = Doubt(code=code, detail=detail, since_at=now)
    record = replace(
        record,
        mission=record.mission.model_copy(update={"doubt": doubt}),
        reported_activity="OUT_OF_CONTACT ",
    )
    record = report(
        work, record, "ACTIVITY", at=now, activity="OUT_OF_CONTACT", code=code, detail=detail
    )
    await raise_alarm(
        work,
        record,
        level="CRITICAL",
        code="MISSION_IN_DOUBT",
        detail=f"{detail}; {_WAITS[code == 'IMPLAUSIBLE']}",
        data={"doubt": code, "mission_state": record.mission.state, **(data or {})},
    )
    await work.save(record)
    return record


def without_doubt(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """The record after its drone has reported about the mission; a changed record is staged.

    A mission with impossible reports stays in doubt.
    """
    if record.mission.doubt is None or is_disbelieved(record):
        return record
    record = replace(
        record,
        mission=record.mission.model_copy(update={"doubt": None}),
        reported_activity=None,
    )
    record = report(work, record, "ACTIVITY")
    work.stage(record)
    return record
