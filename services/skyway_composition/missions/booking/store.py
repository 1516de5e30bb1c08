"""All SQL of booking: one read before planning, and one claim of what an offer needs."""

import json
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Integer,
    Select,
    Text,
    bindparam,
    case,
    cast,
    exists,
    func,
    literal,
    literal_column,
    null,
    select,
    union_all,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.ids import DeliveryId, DroneId, HoldId, MissionId, ProviderId, StationId
from skyway.planner.pad_book import OPEN_MS
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.scheduling.stays import Slot, read_stays
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.calendar.store import calendar_versions
from skyway_composition.links.link import InstructionPlace
from skyway_composition.links.store import COUNT_NEXT, HELD, OCCUPIED
from skyway_composition.missions.mission.record import read_record
from skyway_composition.missions.mission.share_views import mission_for
from skyway_composition.networks.store import Present
from skyway_composition.pads.store import LOCK_STATIONS
from skyway_composition.planning.availability import BookedMission
from skyway_composition.tables import (
    deliveries,
    drone_links,
    guests,
    is_open,
    is_queued,
    missions,
    networks,
    stations,
)

#: The start of a held offer in a calendar: it comes after every mission.
_LAST_MS: Final = OPEN_MS

#: Where and with what charge the drone begins; only a QUEUED mission must begin so.
_of_queued: Final = case((is_queued, missions.c.candidate)).label("candidate")
_ON_MISSION: Final = select(
    missions.c.drone_id, missions.c.mission_id, missions.c.start_ms, missions.c.stays, _of_queued
).where(in_list(missions.c.drone_id, "drone_ids"), is_open)
# A drone may report a mission that is over here: then it has no mission to begin after.
_ENGAGED: Final = union_all(
    _ON_MISSION,
    OCCUPIED.add_columns(
        cast(null(), Text).label("mission_id"),
        cast(null(), BigInteger).label("start_ms"),
        cast(null(), Text).label("stays"),
        cast(null(), Text).label("candidate"),
    ),
    # Nothing can begin after an offer that is held: it may be accepted, or expire.
    HELD.add_columns(
        cast(null(), Text).label("mission_id"),
        literal(_LAST_MS, BigInteger).label("start_ms"),
        cast(null(), Text).label("stays"),
        cast(null(), Text).label("candidate"),
    ),
)
_IS_OF_ATTEMPT: Final = (
    missions.c.delivery_id == bindparam("delivery_id"),
    missions.c.attempt == bindparam("attempt"),
)
_IS_GUEST: Final = (
    guests.c.delivery_id == bindparam("delivery_id"),
    guests.c.attempt == bindparam("attempt"),
)
_own = missions.alias("own")
_MISSIONS: Final = (
    select(missions)
    .where(
        missions.c.mission_id.in_(
            union_all(
                select(_own.c.mission_id).where(
                    _own.c.delivery_id == bindparam("delivery_id"),
                    _own.c.attempt == bindparam("attempt"),
                ),
                select(guests.c.host_id).where(*_IS_GUEST),
            )
        )
    )
    .order_by(missions.c.trip)
)


def _answer(
    question: str,
    text: ColumnElement[str],
    number: ColumnElement[int] | None = None,
    large: ColumnElement[int] | None = None,
    mission_id: ColumnElement[str] | None = None,
    stays: ColumnElement[str | None] | None = None,
    candidate: ColumnElement[str | None] | None = None,
) -> Select[*tuple[Any, ...]]:
    """A query whose rows have one common shape, so that several queries form one statement.

    Any: the type of a column depends on the question.
    """
    return select(
        literal_column(f"'{question}'", Text).label("question"),
        text.label("text"),
        (cast(null(), Integer) if number is None else number).label("number"),
        (cast(null(), BigInteger) if large is None else large).label("large"),
        (cast(null(), Text) if mission_id is None else mission_id).label("mission_id"),
        (cast(null(), Text) if stays is None else stays).label("stays"),
        (cast(null(), Text) if candidate is None else candidate).label("candidate"),
    )


_engaged: Final = _ENGAGED.subquery("engaged")
_FIRST_LOOK: Final = union_all(
    _answer("KNOWN", deliveries.c.delivery_id).where(
        deliveries.c.delivery_id == bindparam("delivery_id")
    ),
    _answer("BOOKED", missions.c.mission_id).where(*_IS_OF_ATTEMPT),
    _answer("BOOKED", guests.c.host_id).where(*_IS_GUEST),
    _answer(
        "ENGAGED",
        _engaged.c.drone_id,
        large=_engaged.c.start_ms,
        mission_id=_engaged.c.mission_id,
        stays=_engaged.c.stays,
        candidate=_engaged.c.candidate,
    ),
    _answer("CALENDAR", drone_links.c.drone_id, large=drone_links.c.calendar_version).where(
        in_list(drone_links.c.drone_id, "drone_ids")
    ),
    _answer("NETWORK", networks.c.network_id, networks.c.version, networks.c.conditions)
    .join(stations, stations.c.network_id == networks.c.network_id)
    .where(stations.c.station_id == bindparam("pickup")),
)

# The order matters: PostgreSQL checks the network before it counts the instruction, and counts the
# instruction before it locks any station.
_world: Final = (
    select(networks.c.network_id)
    .where(
        networks.c.network_id == bindparam("of_network"),
        networks.c.version == bindparam("of_version"),
        networks.c.conditions == bindparam("of_conditions"),
    )
    .with_for_update(read=True)
    .cte("world")
)
_counted: Final = COUNT_NEXT.where(
    exists(select(_world.c.network_id)),
    drone_links.c.calendar_version == bindparam("of_calendar", type_=BigInteger),
).cte("counted")
_locked: Final = LOCK_STATIONS.where(exists(select(_counted.c.drone_id))).cte("locked")
_CLAIM: Final = select(
    _counted, select(func.count()).select_from(_locked).scalar_subquery().label("stations")
)


@dataclass(frozen=True, slots=True)
class SeenCalendars:
    """The calendars of some drones: what is booked in them, and their numbers."""

    missions: tuple[BookedMission, ...]
    versions: Mapping[DroneId, int]


@dataclass(frozen=True, slots=True)
class FirstLook:
    """What a booking reads before it plans, all from one moment.

    A delivery that does not exist was neither booked nor closed. `around` is the network of the
    pickup station.
    """

    delivery_exists: bool
    booked: tuple[Mission, ...]
    calendars: SeenCalendars
    around: Present | None


async def first_look(
    connection: AsyncConnection,
    delivery_id: DeliveryId,
    *,
    attempt: int,
    drone_ids: Collection[DroneId],
    pickup: StationId,
    now_ms: int,
    own_hold: HoldId | None = None,
) -> FirstLook:
    """All that this attempt must read before it plans for these drones.

    Drones that are held at `now_ms`, fleet time, are engaged, except the drones of `own_hold`.
    """
    asked = {
        "delivery_id": delivery_id,
        "attempt": attempt,
        "drone_ids": [*drone_ids],
        "pickup": pickup,
        "now_ms": now_ms,
        "own_hold": own_hold or "",
    }
    answers: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
    for question, *answer in await connection.execute(_FIRST_LOOK, asked):
        answers[question].append(tuple(answer))
    booked: tuple[Mission, ...] = ()
    if answers["BOOKED"]:
        booked = await missions_of(connection, delivery_id, attempt=attempt)
    engaged = _booked(
        (drone_id, mission_id, start_ms, stays, candidate)
        for drone_id, _, start_ms, mission_id, stays, candidate in answers["ENGAGED"]
    )
    versions = dict.fromkeys(drone_ids, 0) | {each[0]: each[2] for each in answers["CALENDAR"]}
    return FirstLook(
        delivery_exists=bool(answers["KNOWN"]),
        booked=booked,
        calendars=SeenCalendars(engaged, versions),
        around=Present(*answers["NETWORK"][0][:3]) if answers["NETWORK"] else None,
    )


async def missions_of(
    connection: AsyncConnection, delivery_id: DeliveryId, *, attempt: int
) -> tuple[Mission, ...]:
    """The missions that were booked for this attempt, in the order of their trips.

    A mission that also flies for others is shown with the packages of this delivery only.
    """
    values = {"delivery_id": delivery_id, "attempt": attempt}
    found = await connection.execute(_MISSIONS, values)
    return tuple(mission_for(read_record(row), delivery_id) for row in found)


async def seen_calendars(
    connection: AsyncConnection,
    drone_ids: Collection[DroneId],
    *,
    now_ms: int,
    own_hold: HoldId | None = None,
) -> SeenCalendars:
    """The missions of these drones that are not over, or that the drones report to fly still.

    A drone that has landed away from every station is busy until people have fetched it. A drone
    that is held at `now_ms`, fleet time, is busy until then, unless `own_hold` holds it.
    """
    # First, because missions may change between the two statements.
    versions = await calendar_versions(connection, drone_ids)
    values = {"drone_ids": [*drone_ids], "now_ms": now_ms, "own_hold": own_hold or ""}
    found = await connection.execute(_ENGAGED, values)
    return SeenCalendars(_booked((*row,) for row in found), versions)


def _booked(
    rows: Iterable[tuple[Any, ...]],  # drone, mission, start, stays and candidate, of any types
) -> tuple[BookedMission, ...]:
    return tuple(
        BookedMission(
            drone_id=DroneId(drone_id),
            mission_id=None if mission_id is None else MissionId(mission_id),
            # A mission that has ended here, but that the drone still reports, comes first.
            start_ms=-1 if start_ms is None else start_ms,
            stays=() if stays is None else read_stays(stays),
            start=None if candidate is None else _start(candidate, start_ms),
            is_held=start_ms == _LAST_MS,
        )
        for drone_id, mission_id, start_ms, stays, candidate in rows
    )


def _start(candidate: str, start_ms: int) -> Slot:
    """Where, when and with what charge a QUEUED mission begins, from its candidate's JSON."""
    drone = json.loads(candidate)
    return Slot(StationId(drone["station_id"]), start_ms, float(drone["soc"]))


async def claim_in_one_statement(
    tx: Tx,
    seen: Snapshot,
    drone_id: DroneId,
    provider_id: ProviderId,
    *,
    station_ids: Collection[StationId],
    now_ms: int,
) -> InstructionPlace | None:
    """The place of the next instruction to a drone, in an unchanged network.

    Locks the network, the drone's link and the stations, in this order. Returns None and does
    nothing when the network or the drone's calendar has changed, the drone has no link yet, or it
    is held at `now_ms`. One statement, for PostgreSQL only; SQLite needs several.
    """
    present = seen.present
    values = {
        "of_network": present.network_id,
        "of_version": present.version,
        "of_conditions": present.conditions,
        "of_drone": drone_id,
        "of_calendar": seen.calendars[drone_id],
        "of_provider": provider_id,
        "station_ids": sorted(set(station_ids)),
        "now_ms": now_ms,
    }
    claimed = (await tx.execute(_CLAIM, values)).one_or_none()
    if claimed is None:
        return None
    *place, _ = claimed
    return InstructionPlace(*place)
