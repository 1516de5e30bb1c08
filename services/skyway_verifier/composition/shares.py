"""The rules of shared missions, and whose package flies under which id."""

import json
from collections import defaultdict
from collections.abc import Mapping
from itertools import combinations
from operator import attrgetter
from typing import Any, Final

from skyway_composition.missions.mission.share import Share, read_shares
from skyway_composition.tables import custody, deliveries, guests, is_open, missions
from sqlalchemy import and_, exists, select

from skyway_verifier.finders import each_where, readable
from skyway_verifier.rule import Rule, Survey


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
