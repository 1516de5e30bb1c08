"""All SQL that a booking begins with, before anything is locked."""

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
    literal_column,
    null,
    select,
    union_all,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.ids import DeliveryId, DroneId, StationId
from skyway.runtime.among import among
from skyway_composition.links.store import OCCUPIED
from skyway_composition.networks.store import Present
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
_OUTLOOK: Final = union_all(
    _answer("KNOWN", deliveries.c.delivery_id).where(
        deliveries.c.delivery_id == bindparam("delivery_id")
    ),
    _answer("BOOKED", missions.c.body, missions.c.trip).where(*_IS_OF_ATTEMPT),
    _answer("BUSY", _busy.c.drone_id),
    _answer("NETWORK", networks.c.network_id, networks.c.version, networks.c.conditions)
    .join(stations, stations.c.network_id == networks.c.network_id)
    .where(stations.c.station_id == bindparam("pickup")),
)


@dataclass(frozen=True, slots=True)
class Outlook:
    """What a booking knows when it begins to plan, all as it was at one moment.

    A delivery that is not known was neither booked nor closed; `around` is the network of the
    pickup station.
    """

    is_known: bool
    booked: tuple[Mission, ...]
    busy: frozenset[DroneId]
    around: Present | None


async def outlook(
    connection: AsyncConnection,
    delivery_id: DeliveryId,
    *,
    attempt: int,
    drone_ids: Collection[DroneId],
    pickup: StationId,
) -> Outlook:
    """What there is to know for this attempt to book some of these drones."""
    asked = {
        "delivery_id": delivery_id,
        "attempt": attempt,
        "drone_ids": [*drone_ids],
        "pickup": pickup,
    }
    told: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
    for question, *answer in await connection.execute(_OUTLOOK, asked):
        told[question].append(tuple(answer))
    in_order = sorted(told["BOOKED"], key=lambda each: each[1])
    return Outlook(
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
