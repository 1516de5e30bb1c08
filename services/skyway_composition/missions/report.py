"""Mission reports: what the gateway and the registry are told, in order per mission."""

from dataclasses import replace
from datetime import datetime
from typing import Any, Final

from skyway.contracts.mission import MissionReport
from skyway.contracts.mission_reports import MISSION_REPORTS
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch

#: What makes a drone busy or free: all that the registry wants to know.
_OF_THE_DRONE: Final = ("ACCEPTED", "REFUSED", "ENDED")


def report(
    watch: Watch,
    record: MissionRecord,
    kind: str,
    *,
    at: datetime,
    **fields: Any,  # the members of MissionReport that this kind carries, checked by the model
) -> MissionRecord:
    """The record after one more thing was told of its mission; the caller saves it."""
    mission = record.mission
    told = MissionReport.model_validate(
        {
            "report_id": watch.mint("rpt"),
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
    watch.tx.report("gateway", MISSION_REPORTS, told, stream=mission.mission_id)
    if kind in _OF_THE_DRONE:
        watch.tx.report("registry", MISSION_REPORTS, told, stream=mission.mission_id)
    return replace(record, report_seq=told.seq)
