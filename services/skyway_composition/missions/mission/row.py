"""A mission as a row: columns for what is searched, JSON for the remaining values."""

from typing import Any, Final

from pydantic import TypeAdapter

from skyway.contracts.candidate import Candidate
from skyway.contracts.mission import Mission, PackageEta
from skyway.delivery.request import DeliveryRequest
from skyway.json_model import JsonCache
from skyway.scheduling.stays import stays_json
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.record import (
    Aim,
    MissionRecord,
    PlannedIn,
    Proposal,
    Stuck,
    Trouble,
)
from skyway_composition.missions.mission.share import read_shares, shares_json

#: How many values of one model are cached, about 10 KiB each. The dispatcher reads all open
#: missions of a fleet: a smaller cache would lose those that drones report about next.
_MOST: Final = 4_000

_AIMS: Final = TypeAdapter(tuple[Aim, ...])


#: Reads and writes the arrival times with which a QUEUED mission was booked.
PROMISED: Final = TypeAdapter(tuple[PackageEta, ...])


# A mission is read again soon after it was written, most often by the same replica: a drone answers
# about a second after its booking. The request seldom changes.
_MISSIONS: Final = JsonCache(Mission, most=_MOST)
_REQUESTS: Final = JsonCache(DeliveryRequest, most=_MOST)
_CANDIDATES: Final = JsonCache(Candidate, most=_MOST)


def new_row(record: MissionRecord) -> dict[str, Any]:  # column values of any type
    """All columns of a new mission."""
    mission = record.mission
    return {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "trip": mission.trip,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "network_id": record.network_id,
        "request": _REQUESTS.write(record.request),
        "candidate": _CANDIDATES.write(record.candidate),
        "traceparent": record.traceparent,
        "promised": PROMISED.dump_json(record.promised).decode() if record.promised else None,
        "pooling_at": record.request.pickup.station_id if record.may_be_shared else None,
        **changing_columns(record),
    }


def changing_columns(record: MissionRecord) -> dict[str, Any]:  # column values of any type
    """The columns that change while a mission lives."""
    mission, planned_in, stays = record.mission, record.planned_in, record.stays
    return {
        "state": mission.state,
        "start_ms": moment_to_ms(mission.start_at),
        "released_ms": moment_to_ms(mission.released_at),
        "expires_ms": record.expires_ms,
        "body": _MISSIONS.write(mission),
        "report_seq": record.report_seq,
        "told": record.reported_activity,
        "stuck": None if record.stuck is None else record.stuck.model_dump_json(),
        "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
        "proposal": None if record.proposal is None else record.proposal.model_dump_json(),
        "aims": _AIMS.dump_json(record.aims).decode(),
        "loading": mission.loading,
        "stays": stays_json(stays) if stays else None,
        "served_ms": record.served_ms,
        "planned_version": None if planned_in is None else planned_in.version,
        "planned_conditions": None if planned_in is None else planned_in.conditions,
        "shares": shares_json(record.shares),
    }


def read_record(row: Any) -> MissionRecord:  # a row of missions, whose columns have any type
    """The mission in a row."""
    return MissionRecord(
        mission=_MISSIONS.read(row.body),
        network_id=row.network_id,
        request=_REQUESTS.read(row.request),
        candidate=_CANDIDATES.read(row.candidate),
        expires_ms=row.expires_ms,
        report_seq=row.report_seq,
        reported_activity=row.told,
        stuck=None if row.stuck is None else Stuck.read(row.stuck),
        trouble=None if row.trouble is None else Trouble.read(row.trouble),
        proposal=None if row.proposal is None else Proposal.read(row.proposal),
        aims=_AIMS.validate_json(row.aims),
        planned_in=(
            None
            if row.planned_version is None
            else PlannedIn(row.planned_version, row.planned_conditions)
        ),
        traceparent=row.traceparent,
        promised=() if row.promised is None else PROMISED.validate_json(row.promised),
        shares=() if row.shares is None else read_shares(row.shares),
    )
