"""Reports to the gateway and the registry, and alarms to operators and providers."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any, Final

from skyway.contracts.drone_health import AlarmLevel
from skyway.contracts.mission_reports import MISSION_REPORTS, MissionReport
from skyway.ids import StationId
from skyway.units import moment_to_ms
from skyway_composition.alarms import store
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: The reports that make a drone busy or free; the registry needs no others.
_OF_THE_DRONE: Final = ("ACCEPTED", "REFUSED", "ENDED")


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
    mission = record.mission
    sent = MissionReport.model_validate(
        {
            "report_id": work.mint("rpt"),
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
    work.tx.report("gateway", MISSION_REPORTS, sent, stream=mission.mission_id)
    if kind in _OF_THE_DRONE:
        work.tx.report("registry", MISSION_REPORTS, sent, stream=mission.mission_id)
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
    await store.add(
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
