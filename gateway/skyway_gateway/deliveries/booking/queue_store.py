"""The SQL of the queue of deliveries with packages that wait."""

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Text, and_, bindparam, update

from skyway.contracts.candidate import ProviderReason
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.records.delivery_rows import (
    Values,
    queued_of,
    reasons_text,
    stored_of,
)
from skyway_gateway.deliveries.records.delivery_store import NEXT_VERSION, with_parts
from skyway_gateway.deliveries.records.stored_delivery import DeliveryCache, QueuedDelivery
from skyway_gateway.tables import deliveries

#: How long a claim holds unless it is renewed, seconds of wall time. After that, another process
#: books what a killed process had claimed. If two processes book the same delivery, composition
#: gives both the same answer: a claim that ends too early costs a question, not a second drone.
_LEASE_S: Final = 3.0

# Statements that every delivery runs are built once: building one takes as long as running it.

_CLAIMING: Final = Claiming.of(
    deliveries,
    where=and_(deliveries.c.is_queued, deliveries.c.next_try_wall_ms <= NOW_MS),
    order_by=[deliveries.c.next_try_wall_ms, deliveries.c.delivery_id],
)
_HOLDING: Final = (
    update(deliveries)
    .where(
        in_list(deliveries.c.delivery_id, "held"),
        deliveries.c.claimed_by == bindparam("claimant", type_=Text),
    )
    .values(claimed_until_ms=bindparam("until_ms", type_=BigInteger))
)


def held_by(claimant: str, clock: FleetClock) -> Values:
    """The columns of a new row that its process claims immediately."""
    return {"claimed_by": claimant, "claimed_until_ms": _lease_end_ms(clock)}


async def claim_queued(
    db: Database, *, limit: int, claimant: str, clock: FleetClock, cache: DeliveryCache
) -> Sequence[QueuedDelivery]:
    """Claim deliveries whose booking is due, the longest waiting first."""
    values = claim_values(limit=limit, claimant=claimant, lease_s=_LEASE_S, clock=clock)
    due = _CLAIMING.in_order(await db.write_alone(_CLAIMING.statement, values))
    found = cache.matching((row.delivery_id, row.version) for row in due)
    unknown = [row for row in due if row.delivery_id not in found]
    if unknown:
        # Parts that change meanwhile are of a later version: nothing is written from these.
        async with db.read() as connection:
            for row, delivery in zip(unknown, await with_parts(connection, unknown), strict=True):
                found[delivery.delivery_id] = stored_of(row, delivery)
    return [queued_of(row, found[row.delivery_id]) for row in due]


async def hold(
    db: Database, held: Collection[DeliveryId], *, claimant: str, clock: FleetClock
) -> None:
    """Renew the claimant's claims of these deliveries; claims that others took over stay theirs."""
    values = {"held": [*held], "claimant": claimant, "until_ms": _lease_end_ms(clock)}
    await db.write_alone(_HOLDING, values)


async def free_claims(tx: Tx) -> None:
    """Free all claims. Only for SQLite, where all earlier claimants are dead at the start."""
    await tx.execute(update(deliveries).where(deliveries.c.is_queued).values(FREE))


async def try_later(
    tx: Tx,
    delivery_id: DeliveryId,
    *,
    next_try_at: datetime,
    reasons: Sequence[ProviderReason] | None,
) -> None:
    """Leave a delivery in the queue until a moment of wall time; None keeps its reasons."""
    values: dict[str, object] = {"next_try_wall_ms": moment_to_ms(next_try_at), **FREE}
    if reasons is not None:
        values |= {"reasons": reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def note_reasons(tx: Tx, delivery_id: DeliveryId, reasons: Sequence[ProviderReason]) -> None:
    """Store the reasons for giving up the packages that wait, before they are given up."""
    values = {"reasons": reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


def _lease_end_ms(clock: FleetClock) -> int:
    return moment_to_ms(clock.wall_now()) + int(_LEASE_S * 1000)
