"""Reports to the gateway and the registry, and alarms to operators and providers."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any, Final

from skyway.contracts.drone_report import AlarmLevel
from skyway.contracts.mission_reports import MISSION_REPORTS, FreeFrom, MissionReport
from skyway.ids import StationId
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition import alarm_store
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: The reports that say when a drone is busy or free; the registry needs no others.
_OF_THE_DRONE: Final = ("QUEUED", "ACCEPTED", "RETIMED", "REFUSED", "ENDED")


def report(
    work: MissionUnitOfWork,
    record: MissionRecord,
    kind: str,
    *,
    at: datetime,
    **fields: Any,  # the members of MissionReport that this kind carries, checked by the model
) -> MissionRecord:
    """Report a change of a mission; the caller saves the returned record.

    Reports of one mission are numbered, and arrive in order.
    """
    return report_in(work.tx, work.mint, record, kind, at=at, **fields)


def report_in(
    tx: Tx,
    mint: Mint,
    record: MissionRecord,
    kind: str,
    *,
    at: datetime,
    **fields: Any,  # as for `report`
) -> MissionRecord:
    """Report as `report` does, in a transaction that has locked the mission or adds it."""
    mission = record.mission
    sent = MissionReport.model_validate(
        {
            "report_id": mint("rpt"),
            "delivery_id": mission.delivery_id,
            "attempt": mission.attempt,
            "trip": mission.trip,
            "mission_id": mission.mission_id,
            "provider_id": mission.provider_id,
            "drone_id": mission.drone_id,
            "seq": record.report_seq + 1,
            "kind": kind,
            "at": at,
            "mission_state": mission.state,
            **fields,
        }
    )
    tx.report("gateway", MISSION_REPORTS, sent, stream=mission.mission_id)
    if kind in _OF_THE_DRONE:
        tx.report("registry", MISSION_REPORTS, sent, stream=mission.mission_id)
    return replace(record, report_seq=sent.seq)


async def raise_alarm(
    work: MissionUnitOfWork,
    record: MissionRecord,
    *,
    level: AlarmLevel,
    code: str,
    detail: str,
    station_id: StationId | None = None,
    data: Mapping[str, Any] | None = None,  # numbers behind the code
) -> None:
    """Raise an alarm about a mission and its drone now."""
    await alarm_store.add(
        work.tx,
        level=level,
        code=code,
        detail=detail,
        at_ms=moment_to_ms(work.clock.now()),
        mint=work.mint,
        provider_id=record.mission.provider_id,
        drone_id=record.drone_id,
        mission_id=record.mission_id,
        station_id=station_id,
        data=data,
    )


def free_from(record: MissionRecord) -> FreeFrom | None:
    """Where and when the mission's drone can begin another one; None if that is not known."""
    first = next(iter(record.stays), None)
    if first is None:
        return None
    at = ms_to_moment(first.from_ms)
    return FreeFrom(at=at, station_id=first.station_id, soc=first.soc_from)
