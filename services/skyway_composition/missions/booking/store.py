"""All SQL that a booking begins with: a look at everything, and taking what its offer needs."""

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Integer,
    Select,
    Text,
    bindparam,
    cast,
    exists,
    func,
    literal_column,
    null,
    select,
    union_all,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.ids import DeliveryId, DroneId, ProviderId, StationId
from skyway.runtime.sql.among import among
from skyway.runtime.sql.database import Tx
from skyway_composition.links.link import InstructionPlace
from skyway_composition.links.store import COUNT_NEXT, OCCUPIED
from skyway_composition.networks.store import Present
from skyway_composition.pads.store import LOCK_STATIONS
from skyway_composition.tables import deliveries, is_live, missions, networks, stations

_ON_MISSION: Final = select(missions.c.drone_id).where(
    among(missions.c.drone_id, "drone_ids"), is_live
)
_BUSY: Final = union_all(_ON_MISSION, OCCUPIED)
_IS_OF_ATTEMPT: Final = (
    missions.c.delivery_id == bindparam("delivery_id"),
    missions.c.attempt == bindparam("attempt"),
)
_MISSIONS: Final = select(missions.c.body).where(*_IS_OF_ATTEMPT).order_by(missions.c.trip)


def _answer(
    question: str,
    text: ColumnElement[str],
    number: ColumnElement[int] | None = None,
    large: ColumnElement[int] | None = None,
) -> Select[*tuple[Any, ...]]:
    """An answer in rows of one shape, so that several questions are one statement.

    Any: what a column holds is known by its question.
    """
    return select(
        literal_column(f"'{question}'", Text).label("question"),
        text.label("text"),
        (cast(null(), Integer) if number is None else number).label("number"),
        (cast(null(), BigInteger) if large is None else large).label("large"),
    )


_busy: Final = _BUSY.subquery("busy")
_FIRST_LOOK: Final = union_all(
    _answer("KNOWN", deliveries.c.delivery_id).where(
        deliveries.c.delivery_id == bindparam("delivery_id")
    ),
    _answer("BOOKED", missions.c.body, missions.c.trip).where(*_IS_OF_ATTEMPT),
    _answer("BUSY", _busy.c.drone_id),
    _answer("NETWORK", networks.c.network_id, networks.c.version, networks.c.conditions)
    .join(stations, stations.c.network_id == networks.c.network_id)
    .where(stations.c.station_id == bindparam("pickup")),
)

# In this order: PostgreSQL asks whether there is a world before it counts, and whether it has
# counted before it locks any station.
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
_counted: Final = COUNT_NEXT.where(exists(select(_world.c.network_id))).cte("counted")
_locked: Final = LOCK_STATIONS.where(exists(select(_counted.c.drone_id))).cte("locked")
_TAKE: Final = select(
    _counted, select(func.count()).select_from(_locked).scalar_subquery().label("stations")
)


@dataclass(frozen=True, slots=True)
class FirstLook:
    """What a booking knows when it begins to plan, all as it was at one moment.

    A delivery that is not known was neither booked nor closed; `around` is the network of the
    pickup station.
    """

    is_known: bool
    booked: tuple[Mission, ...]
    busy: frozenset[DroneId]
    around: Present | None


async def first_look(
    connection: AsyncConnection,
    delivery_id: DeliveryId,
    *,
    attempt: int,
    drone_ids: Collection[DroneId],
    pickup: StationId,
) -> FirstLook:
    """What there is to know for this attempt to book some of these drones."""
    asked = {
        "delivery_id": delivery_id,
        "attempt": attempt,
        "drone_ids": [*drone_ids],
        "pickup": pickup,
    }
    told: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
    for question, *answer in await connection.execute(_FIRST_LOOK, asked):
        told[question].append(tuple(answer))
    in_order = sorted(told["BOOKED"], key=lambda each: each[1])
    return FirstLook(
        is_known=bool(told["KNOWN"]),
        booked=tuple(Mission.read(body) for body, *_ in in_order),
        busy=frozenset(drone_id for drone_id, *_ in told["BUSY"]),
        around=Present(*told["NETWORK"][0]) if told["NETWORK"] else None,
    )


async def missions_of(
    connection: AsyncConnection, delivery_id: DeliveryId, *, attempt: int
) -> tuple[Mission, ...]:
    """The missions that were booked for this attempt, in the order of their trips."""
    wanted = {"delivery_id": delivery_id, "attempt": attempt}
    found = await connection.execute(_MISSIONS, wanted)
    return tuple(Mission.read(body) for body in found.scalars())


async def busy_among(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> frozenset[DroneId]:
    """Those of these drones that are on a mission, or say so: given up on, they may still fly.

    So are those that are down away from every station, until people have fetched them.
    """
    found = await connection.execute(_BUSY, {"drone_ids": [*drone_ids]})
    return frozenset(found.scalars())


async def claim_in_one_statement(
    tx: Tx,
    present: Present,
    drone_id: DroneId,
    provider_id: ProviderId,
    *,
    station_ids: Collection[StationId],
) -> InstructionPlace | None:
    """The place of the next instruction to a drone, in a network that is still as it was.

    The network, the drone's link and the stations are locked by that, in this order. None when
    the network has changed or the link was never begun: then nothing of it is done. PostgreSQL's
    statement; SQLite, which has no locks, needs several.
    """
    wanted = {
        "of_network": present.network_id,
        "of_version": present.version,
        "of_conditions": present.conditions,
        "of_drone": drone_id,
        "of_provider": provider_id,
        "station_ids": sorted(set(station_ids)),
    }
    taken = (await tx.execute(_TAKE, wanted)).one_or_none()
    if taken is None:
        return None
    *place, _ = taken
    return InstructionPlace(*place)
