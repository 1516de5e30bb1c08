"""The rules of drones' calendars: QUEUED missions follow one another in place, time and charge."""

from collections import defaultdict
from itertools import pairwise
from typing import Any, Final

from skyway_composition.missions.mission.record import read_record
from skyway_composition.missions.mission.store import NO_CONDITIONS
from skyway_composition.tables import (
    better_orders,
    instructions,
    is_live,
    is_open,
    is_queued,
    missions,
    networks,
)
from skyway_composition.tables.missions import DAY_MS
from sqlalchemy import and_, exists, or_, select

from skyway.contracts.candidate import Candidate
from skyway.scheduling.stays import Slot, Stay, read_stays, stay_to_begin_at, stays_json
from skyway_verifier.finders import any_of, readable, rows_where
from skyway_verifier.rule import Rule, Survey

_other = missions.alias("other")

_PLAN_AGAIN: Final = (
    "Set `planned_conditions` of the drone's QUEUED missions to -1: composition plans them again."
)


def read_stored_stays(text: str) -> tuple[Stay, ...]:
    """The stays in this JSON; a ValueError says why it holds no stays."""
    try:
        return read_stays(text)
    except TypeError as error:
        raise ValueError(str(error)) from error


def _differs_from_plan(row: Any) -> bool:  # a row of missions
    """Whether its stays, or its end of service, are not those of the plan in its body."""
    record = read_record(row)
    # A trouble makes the plan doubtful before the stays are saved again.
    is_sure = record.trouble is None and record.stuck is None
    stays = stays_json(record.stays) if record.stays else None
    return row.served_ms != record.served_ms or (is_sure and row.stays != stays)


async def _disconnected(survey: Survey) -> list[str]:
    """QUEUED missions that do not begin where and when the QUEUED mission before them ends.

    Missions that are about to be planned again are left out.
    """
    rows = await survey.rows(select(missions).where(is_queued).order_by(missions.c.start_ms))
    by_drone: dict[str, list[Any]] = defaultdict(list)  # rows of missions
    for row in rows:
        by_drone[row.drone_id].append(row)
    return [
        after.mission_id
        for queued in by_drone.values()
        for before, after in pairwise(queued)
        if after.planned_conditions != NO_CONDITIONS
        and (before.stays is None or not readable(True, _follows, before, after))
    ]


def _follows(before: Any, after: Any) -> bool:  # rows of missions
    candidate, stays = Candidate.read(after.candidate), read_stays(before.stays)
    begins = Slot(candidate.station_id, after.start_ms, candidate.soc)
    return stay_to_begin_at(stays, begins, not_left_before_ms=0) is not None


CALENDARS: Final = (
    Rule(
        "I16 QUEUED missions of a drone do not overlap",
        select(missions.c.mission_id)
        .where(is_queued)
        .join(
            _other,
            and_(
                _other.c.drone_id == missions.c.drone_id,
                _other.c.mission_id != missions.c.mission_id,
                _other.c.state == "QUEUED",
                _other.c.start_ms < missions.c.served_ms,
                missions.c.start_ms < _other.c.served_ms,
            ),
        ),
        _PLAN_AGAIN + " Make the constraint `drone_time_taken` again.",
    ),
    Rule(
        "I16 a QUEUED mission begins where the one before it leaves the drone",
        _disconnected,
        _PLAN_AGAIN,
    ),
    Rule(
        "I16 a QUEUED mission has a plan of its network, and only a QUEUED one waits",
        any_of(
            missions.c.mission_id,
            and_(is_live, missions.c.planned_version.is_not(None)),
            and_(
                is_queued,
                or_(
                    missions.c.planned_version.is_(None),
                    missions.c.planned_conditions.is_(None),
                    missions.c.served_ms <= missions.c.start_ms,
                ),
            ),
        ),
        "Set `planned_version` and `planned_conditions` to -1 for a QUEUED mission: composition "
        "plans it again. Set both to NULL for a mission that was sent.",
    ),
    Rule(
        "I16 a QUEUED mission was not sent to its drone",
        select(missions.c.mission_id).where(
            is_queued,
            exists().where(
                instructions.c.mission_id == missions.c.mission_id,
                instructions.c.kind == "MISSION",
            ),
        ),
        "The state was set back by hand, and the drone may fly the mission. Set the state to "
        "BOOKED in the column and in `body`, and `planned_version` and `planned_conditions` to "
        "NULL: the drone's answer then sets the right state.",
    ),
    Rule(
        "I16 a mission's stays and end of service are those of its plan",
        rows_where(select(missions).where(is_open), _differs_from_plan, "mission_id"),
        "Other missions begin where the stays say. Set `served_ms` to the start plus "
        "`plan.delivery_time_s` in `body`, and `stays` to NULL: nothing is booked behind this "
        "mission until its next report fills them.",
    ),
    Rule(
        "I12 a mission was planned with no later version or condition than its network has",
        select(missions.c.mission_id)
        .join(networks, networks.c.network_id == missions.c.network_id)
        .where(
            or_(
                missions.c.planned_version > networks.c.version,
                missions.c.planned_conditions > networks.c.conditions,
            )
        ),
        _PLAN_AGAIN,
    ),
    Rule(
        "what better orders have saved is counted by days",
        any_of(
            better_orders.c.provider_id,
            better_orders.c.day_ms % DAY_MS != 0,
            better_orders.c.orders < 1,
            better_orders.c.moves < 0,
        ),
        "Only GET /v1/stats/missions shows these rows of `better_orders`: delete the row.",
    ),
)
