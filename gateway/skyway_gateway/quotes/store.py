"""All SQL of quotes."""

from datetime import datetime
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy import and_, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import ProviderReason
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, OfferId, QuoteId, SubjectId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.quotes.quote import Offer, Quote
from skyway_gateway.tables import quotes

_OFFERS: Final = TypeAdapter(tuple[Offer, ...])
_REASONS: Final = TypeAdapter(tuple[ProviderReason, ...])


async def add(tx: Tx, quote: Quote, *, customer_id: SubjectId) -> None:
    """Add a new quote."""
    row = {
        "quote_id": quote.quote_id,
        "customer_id": customer_id,
        "request": quote.request.model_dump_json(),
        "offers": _OFFERS.dump_json(quote.offers).decode(),
        "infeasible": _REASONS.dump_json(quote.infeasible).decode(),
        "made_ms": moment_to_ms(quote.made_at),
        "expires_wall_ms": moment_to_ms(quote.expires_at),
    }
    await tx.execute(insert(quotes).values(row))


async def one_of(connection: AsyncConnection, caller: Caller, quote_id: QuoteId) -> Quote:
    """The caller's own quote.

    Raises
    ------
    NotFound
        There is no such quote, or it is not the caller's.
    """
    statement = select(quotes).where(
        quotes.c.quote_id == quote_id, owned(caller, quotes.c.customer_id)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("quote", quote_id)
    return _quote(row)


async def mark_accepted(
    tx: Tx, quote_id: QuoteId, offer_id: OfferId, *, delivery_id: DeliveryId
) -> bool:
    """Note that an offer is accepted; False when an offer of the quote was accepted before."""
    this = and_(quotes.c.quote_id == quote_id, quotes.c.taken_offer_id.is_(None))
    accepted = {"taken_offer_id": offer_id, "delivery_id": delivery_id}
    return (await tx.execute(update(quotes).where(this).values(accepted))).rowcount == 1


async def delete_expired(tx: Tx, *, before: datetime) -> None:
    """Delete the quotes that expired before a moment of wall time."""
    is_old = quotes.c.expires_wall_ms < moment_to_ms(before)
    await tx.execute(delete(quotes).where(is_old))


def _quote(row: AnyRow) -> Quote:
    return Quote(
        quote_id=row.quote_id,
        request=DeliveryRequest.read(row.request),
        made_at=ms_to_moment(row.made_ms),
        expires_at=ms_to_moment(row.expires_wall_ms),
        offers=_OFFERS.validate_json(row.offers),
        infeasible=_REASONS.validate_json(row.infeasible),
        taken_offer_id=row.taken_offer_id,
        delivery_id=row.delivery_id,
    )
