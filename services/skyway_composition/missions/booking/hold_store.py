"""Held offers, whether they can still be booked, and all SQL of their drones and pads.

A hold is stored with its offers: their trips, and what they were planned with.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Self

from pydantic import TypeAdapter
from sqlalchemy import BigInteger, Text, bindparam, delete, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import OfferHold, OfferLimits
from skyway.contracts.quote import HoldLoss
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, HoldId, NetworkId, PackageId, SubjectId
from skyway.json_model import JsonModel
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list
from skyway.scheduling.trip import BookedPad, merged
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.missions.booking.store import SeenCalendars, seen_calendars
from skyway_composition.networks.store import Present
from skyway_composition.planning.offer import Offer
from skyway_composition.tables import drone_links, missions, offer_holds, pad_reservations

_THIS: Final = offer_holds.c.hold_id == bindparam("this_hold")
_FIND: Final = select(offer_holds).where(_THIS)
_LOCK: Final = _FIND.with_for_update()
_DELETE: Final = delete(offer_holds).where(_THIS)
_FREE_PADS: Final = delete(pad_reservations).where(
    pad_reservations.c.hold_id == bindparam("this_hold")
)
_IS_HELD_BY: Final = drone_links.c.held_by == bindparam("this_hold")
# Drones are locked in the order of their ids, as every booking does.
_LOCK_DRONES: Final = (
    select(drone_links.c.drone_id)
    .where(_IS_HELD_BY)
    .order_by(drone_links.c.drone_id)
    .with_for_update()
)
_DRONES: Final = select(drone_links.c.drone_id).where(_IS_HELD_BY)
_FREE_DRONES: Final = (
    update(drone_links)
    .where(_IS_HELD_BY)
    .values(held_by=None, held_until_ms=None, calendar_version=drone_links.c.calendar_version + 1)
)
_MARK_DRONES: Final = (
    update(drone_links)
    .where(in_list(drone_links.c.drone_id, "drone_ids"))
    .values(
        held_by=bindparam("this_hold", type_=Text),
        held_until_ms=bindparam("until_ms", type_=BigInteger),
        calendar_version=drone_links.c.calendar_version + 1,
    )
    .returning(drone_links.c.drone_id, drone_links.c.calendar_version)
)
_EXTEND: Final = (
    update(offer_holds).where(_THIS).values(until_ms=bindparam("to_ms", type_=BigInteger)),
    update(drone_links)
    .where(_IS_HELD_BY)
    .values(held_until_ms=bindparam("to_ms", type_=BigInteger)),
    update(pad_reservations)
    .where(pad_reservations.c.hold_id == bindparam("this_hold"))
    .values(held_until_ms=bindparam("to_ms", type_=BigInteger)),
)
_EXPIRED: Final = (
    select(offer_holds.c.hold_id)
    .where(offer_holds.c.until_ms <= bindparam("now_ms"))
    .order_by(offer_holds.c.hold_id)
)
_OWN_PADS: Final = (
    select(pad_reservations)
    .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
    .where(in_list(missions.c.drone_id, "drone_ids"))
)


class HeldOffer(JsonModel):
    """An offer whose drones and pads are held, and the world with which it was planned.

    `calendars` are the numbers of the drones' calendars when the hold began.
    """

    network_id: NetworkId
    version: int
    conditions: int
    offer: Offer
    calendars: Mapping[DroneId, int]

    @classmethod
    def of(cls, offer: Offer, present: Present) -> Self:
        """The offer as it was planned in this network, before its drones are held."""
        return cls(
            network_id=present.network_id,
            version=present.version,
            conditions=present.conditions,
            offer=offer,
            calendars={},
        )

    def held_with(self, calendars: Mapping[DroneId, int]) -> Self:
        """The offer after its drones were held; `calendars` are their numbers since then."""
        own = {each: calendars[each] for each in self.drone_ids}
        return self.model_copy(update={"calendars": own})

    @property
    def seen(self) -> Snapshot:
        """What a booking of the offer depends on."""
        return Snapshot(Present(self.network_id, self.version, self.conditions), self.calendars)

    @property
    def drone_ids(self) -> tuple[DroneId, ...]:
        """The held drones."""
        return tuple(part.candidate.drone_id for part in self.offer.parts)

    @property
    def package_ids(self) -> frozenset[PackageId]:
        """The packages that it carries."""
        return frozenset(
            package.package_id for part in self.offer.parts for package in part.request.packages
        )

    def keeps(self, promised: OfferLimits) -> bool:
        """Whether this is an offer of the promised provider for at most the promised price."""
        price = self.offer.price
        is_same = (self.offer.provider_id, price.currency) == (
            promised.provider_id,
            promised.price.currency,
        )
        return is_same and price.amount <= promised.price.amount

    @property
    def starts_ms(self) -> int:
        """The earliest start of its trips, fleet time in milliseconds."""
        return min(part.trip.start_ms for part in self.offer.parts)


#: Reads and writes the offers of one hold.
HELD_OFFERS: Final = TypeAdapter(tuple[HeldOffer, ...])


def pads_of_offers(offers: Sequence[HeldOffer]) -> tuple[BookedPad, ...]:
    """The pads of all trips of these offers."""
    return merged(
        pad for held in offers for part in held.offer.parts for pad in part.trip.booked_pads
    )


@dataclass(frozen=True, slots=True)
class Hold:
    """Offers that are held until `until_ms`, fleet time; their drones and pads are one bundle."""

    hold_id: HoldId
    until_ms: int
    offers: tuple[HeldOffer, ...]


def held_offer(hold: Hold | None, number: int, *, now_ms: int) -> HeldOffer | None:
    """The numbered offer of a hold that has not expired; None without one."""
    if hold is None or hold.until_ms <= now_ms or number >= len(hold.offers):
        return None
    return hold.offers[number]


def hold_loss(
    held: HeldOffer,
    *,
    request: DeliveryRequest,
    present: Present,
    now: SeenCalendars,
    now_ms: int,
) -> HoldLoss | None:
    """Why a held offer cannot be booked as it was planned; None if it can.

    `now` are the present calendars of its drones, `now_ms` is fleet time.
    """
    if held.starts_ms < now_ms:
        return "EXPIRED"
    if held.seen.present != present:
        return "NETWORK_CHANGED"
    if held.package_ids != {each.package_id for each in request.packages}:
        return "REQUEST_CHANGED"
    if now.versions == held.calendars:
        return None
    is_occupied = any(each.mission_id is None for each in now.missions)
    return "DRONE_NOT_FREE" if is_occupied else "CALENDAR_CHANGED"


async def usable_offer(
    connection: AsyncConnection,
    hold: OfferHold,
    promised: OfferLimits,
    *,
    request: DeliveryRequest,
    present: Present,
    now_ms: int,
) -> HeldOffer | HoldLoss:
    """The promised offer if it can be booked as it is held, or why it cannot; see `hold_loss`."""
    found = await find_hold(connection, hold.hold_id)
    held = held_offer(found, hold.number, now_ms=now_ms)
    if held is None or not held.keeps(promised):
        return "EXPIRED"
    now = await seen_calendars(connection, held.drone_ids, now_ms=now_ms, own_hold=hold.hold_id)
    return hold_loss(held, request=request, present=present, now=now, now_ms=now_ms) or held


async def find_hold(connection: AsyncConnection, hold_id: HoldId) -> Hold | None:
    """The hold, expired or not; None without one."""
    row = (await connection.execute(_FIND, {"this_hold": hold_id})).one_or_none()
    return None if row is None else _hold(row.hold_id, row.until_ms, row.offers)


async def lock_hold(tx: Tx, hold_id: HoldId) -> Hold | None:
    """The hold, locked until the transaction ends; None without one."""
    row = (await tx.execute(_LOCK, {"this_hold": hold_id})).one_or_none()
    return None if row is None else _hold(row.hold_id, row.until_ms, row.offers)


async def add_hold(
    tx: Tx,
    hold: Hold,
    *,
    customer_id: SubjectId,
    slot: int | None,
    pads: Iterable[BookedPad],
) -> None:
    """Hold locked drones, and pads at locked stations.

    The transaction's end raises `RowRefused`: `pad_taken` when a pad is reserved for some of the
    time, `hold_slot` when another hold of the customer has the slot.
    """
    drone_ids = sorted({each for offer in hold.offers for each in offer.drone_ids})
    marked = await tx.execute(
        _MARK_DRONES,
        {"drone_ids": drone_ids, "this_hold": hold.hold_id, "until_ms": hold.until_ms},
    )
    calendars = {row.drone_id: row.calendar_version for row in marked}
    offers = tuple(each.held_with(calendars) for each in hold.offers)
    row = {
        "hold_id": hold.hold_id,
        "customer_id": customer_id,
        "slot": slot,
        "until_ms": hold.until_ms,
        "offers": HELD_OFFERS.dump_json(offers).decode(),
    }
    tx.add(offer_holds, [row])
    tx.add(
        pad_reservations,
        [
            {
                "station_id": pad.station_id,
                "pad": pad.pad,
                "start_ms": pad.start_ms,
                "end_ms": pad.end_ms,
                "hold_id": hold.hold_id,
                "held_until_ms": hold.until_ms,
            }
            for pad in pads
        ],
    )


async def extend_hold(tx: Tx, hold_id: HoldId, *, until_ms: int) -> None:
    """Let a locked hold last until another moment of fleet time."""
    for statement in _EXTEND:
        await tx.execute(statement, {"this_hold": hold_id, "to_ms": until_ms})


async def drones_of_hold(tx: Tx, hold_id: HoldId | None) -> Sequence[DroneId]:
    """The drones that a locked hold keeps; none without a hold."""
    if hold_id is None:
        return ()
    return (await tx.execute(_DRONES, {"this_hold": hold_id})).scalars().all()


async def free_drones(tx: Tx, hold_id: HoldId) -> None:
    """Give up the drones of a locked hold; its pads must follow, after their stations are locked.

    A transaction that locks other drones too has locked those of the hold with them.
    """
    await tx.execute(_LOCK_DRONES, {"this_hold": hold_id})
    await tx.execute(_FREE_DRONES, {"this_hold": hold_id})


async def free_pads(tx: Tx, hold_id: HoldId) -> None:
    """Give up the pads of a hold, and delete the hold."""
    await tx.execute(_FREE_PADS, {"this_hold": hold_id})
    await tx.execute(_DELETE, {"this_hold": hold_id})


async def delete_expired(db: Database, *, now_ms: int) -> int:
    """Delete the holds that have expired, each in its own transaction; how many there were."""
    async with db.read() as connection:
        expired = (await connection.execute(_EXPIRED, {"now_ms": now_ms})).scalars().all()
    for hold_id in expired:
        async with db.write() as tx:
            hold = await lock_hold(tx, hold_id)
            # It may have been extended meanwhile, because its offer is being accepted.
            if hold is not None and hold.until_ms <= now_ms:
                await free_drones(tx, hold_id)
                await free_pads(tx, hold_id)
    return len(expired)


async def slots_of(connection: AsyncConnection, customer_id: SubjectId) -> dict[int, int]:
    """The numbered holds of a customer, expired or not: until when each lasts, fleet time."""
    found = await connection.execute(
        select(offer_holds.c.slot, offer_holds.c.until_ms).where(
            offer_holds.c.customer_id == customer_id, offer_holds.c.slot.is_not(None)
        )
    )
    return {row.slot: row.until_ms for row in found}


async def pads_of_drones(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> Sequence[BookedPad]:
    """The pads that missions of these drones have reserved: a hold of the drone may share them."""
    found = await connection.execute(_OWN_PADS, {"drone_ids": [*drone_ids]})
    return [BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms) for row in found]


def _hold(hold_id: HoldId, until_ms: int, offers: str) -> Hold:
    return Hold(hold_id, until_ms, HELD_OFFERS.validate_json(offers))
