"""The rules of drones' calendars and of shared missions.

QUEUED missions follow one another in place, time and charge. A shared mission says whose package
flies under which id.
"""

import json
from collections import defaultdict
from collections.abc import Mapping
from itertools import combinations, pairwise
from operator import attrgetter
from typing import Any, Final

from skyway_composition.missions.mission.record import read_record
from skyway_composition.missions.mission.share import Share, read_shares
from skyway_composition.missions.mission.store import NO_CONDITIONS
from skyway_composition.tables import (
    better_orders,
    custody,
    deliveries,
    guests,
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
from skyway_verifier.finders import any_of, each_where, readable, rows_where
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
            and_(
                is_live,
                or_(missions.c.planned_version.is_not(None), missions.c.firm_ms.is_not(None)),
            ),
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


async def shares_of(survey: Survey) -> Mapping[str, tuple[Share, ...]]:
    """By mission: its shares; missions that fly for one delivery only are left out."""
    found: dict[str, tuple[Share, ...]] = {}
    query = select(missions.c.mission_id, missions.c.shares).where(missions.c.shares.is_not(None))
    async for row in survey.each(query):
        if (shares := readable(None, read_shares, row.shares)) is not None:
            found[row.mission_id] = shares
    return found


async def guests_of_hosts(survey: Survey) -> Mapping[str, list[Any]]:
    """By host: its rows of guests."""
    found: dict[str, list[Any]] = defaultdict(list)
    async for row in survey.each(select(guests)):
        found[row.host_id].append(row)
    return found


async def owners(survey: Survey) -> Mapping[tuple[str, str], tuple[str, str] | None]:
    """By mission and flying id of a package: its delivery and its own id.

    None for a package of a guest that was forgotten. Packages of missions that fly for one delivery
    only are left out.
    """
    stored = await survey.once(guests_of_hosts)
    return {
        (mission_id, flying): (
            (share.delivery_id, own)
            if share.mission_id == mission_id
            or any(row.mission_id == share.mission_id for row in stored.get(mission_id, ()))
            else None
        )
        for mission_id, shares in (await survey.once(shares_of)).items()
        for share in shares
        for flying, own in share.packages.items()
    }


async def _unlike_guests(survey: Survey) -> set[str]:
    """Hosts whose shares are not their delivery and their guests."""
    shares, stored = await survey.once(shares_of), await survey.once(guests_of_hosts)
    columns = select(missions.c.mission_id, missions.c.delivery_id)
    hosts = await survey.rows(columns.where(missions.c.shares.is_not(None)))
    wrong = {
        host.mission_id
        for host in hosts
        if (own := shares.get(host.mission_id)) is not None
        and (not own or tuple(host) != (own[0].mission_id, own[0].delivery_id))
    }
    guest = attrgetter("mission_id", "delivery_id", "attempt")
    return wrong | {
        host_id
        for host_id, rows in stored.items()
        if not set(map(guest, rows)) <= set(map(guest, shares.get(host_id, ())))
    }


async def _far_pickups(survey: Survey) -> set[str]:
    """Missions with a share whose pickup is not its own, and not within the metres it allows."""
    shares = await survey.once(shares_of)
    found: set[str] = set()
    query = select(missions.c.mission_id, missions.c.request).where(missions.c.shares.is_not(None))
    async for row in survey.each(query):
        pickup = readable(None, _pickup, row.request)
        if pickup is not None and any(
            share.mission_id == row.mission_id
            or share.near.asked_station_id == pickup
            or share.near.away_m > share.near.within_m
            for share in shares.get(row.mission_id, ())
            if share.near is not None
        ):
            found.add(row.mission_id)
    return found


def _pickup(request: str) -> str:
    station_id: str = json.loads(request)["pickup"]["station_id"]
    return station_id


_FROM_GUESTS: Final = (
    "The gateway has each guest as a mission of its own (`missions` there, with the same id, "
    "delivery and attempt): correct the row of `guests` or the host's `shares` by it."
)

SHARED: Final = (
    Rule(
        "a shared mission has its own delivery and its guests as shares",
        _unlike_guests,
        _FROM_GUESTS,
    ),
    Rule(
        "each package of a shared mission flies under its own id",
        each_where(
            shares_of,
            lambda shares: any(
                not one.packages.keys().isdisjoint(other.packages)
                for one, other in combinations(shares, 2)
            ),
        ),
        "The drone cannot distinguish the packages. Cancel one of the deliveries before it is "
        "loaded; else ask people at the hand-over.",
    ),
    Rule(
        "a pooled price is paid together, and is no higher than the price alone",
        each_where(
            shares_of,
            lambda shares: (
                sum(each.is_pooled for each in shares) == 1
                or any(each.pooled_price.amount > each.price.amount for each in shares)
            ),
        ),
        "`is_pooled` is true in the shares that the drone has loaded together, at least two. The "
        "gateway's copy of each mission has the price that its customer saw.",
    ),
    Rule(
        "a guest is picked up where it asked, or within the metres that it allows",
        _far_pickups,
        "The gateway's copy of the mission has `pickup_station_id` and `pickup_away_m`, and the "
        "delivery's request has `pickup` and `qos.pickup_within_m`: correct `near` in the host's "
        "`shares` by them. If the packages have to be carried too far, inform the customer.",
    ),
    Rule(
        "I6 a package of a guest has a chain of custody",
        select(guests.c.mission_id)
        .join(missions, missions.c.mission_id == guests.c.host_id)
        .where(is_open, ~exists().where(custody.c.delivery_id == guests.c.delivery_id)),
        "All rows of the chain were deleted. The gateway has the same chain (its table "
        "`custody`): copy the rows from there.",
    ),
    Rule(
        "a closed delivery is no guest of a mission that is not over",
        select(guests.c.mission_id)
        .join(missions, missions.c.mission_id == guests.c.host_id)
        .join(
            deliveries,
            and_(
                deliveries.c.delivery_id == guests.c.delivery_id,
                deliveries.c.closed_ms.is_not(None),
            ),
        )
        .where(is_open),
        "The gateway has given the delivery up, so nobody waits for its packages. Find out who "
        "has them, and bring them back to the pickup.",
    ),
)
