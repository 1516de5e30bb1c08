"""A quote as customers see it, and all SQL of quotes and of known networks.

The last known networks are stored, so that a gateway that starts while composition is away can
check requests.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field, TypeAdapter, computed_field
from sqlalchemy import and_, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.message import FleetMoment, WallMoment
from skyway.contracts.mission import OfferHold, OfferLimits, PackageEta
from skyway.contracts.quote import OfferTerms
from skyway.contracts.station_check import NetworkStations
from skyway.delivery.offer import Tariff
from skyway.delivery.request import DeliveryRequest, Place
from skyway.ids import DeliveryId, HoldId, OfferId, QuoteId, StationId, SubjectId, is_live_id
from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.places.served import ServedPlace
from skyway_gateway.tables import known_networks, quotes

#: How long an offer can be accepted, seconds of wall time (docs/reference/time.md).
OFFER_LIFE_S: Final = 120.0

#: The quotes that one transaction deletes at most.
_DELETED_TOGETHER: Final = 1000


class OfferedPackage(PackageEta):
    """When and where a package of an offer is expected, and what would be promised now."""

    destination_station_id: Annotated[
        StationId, Field(description="The station where the package is handed over.")
    ]
    eta_p90_at: Annotated[
        FleetMoment | None,
        Field(description="When it has come in nine of ten cases; null before that is known."),
    ] = None
    due_at: Annotated[
        FleetMoment | None,
        Field(
            description="What is promised: `eta_p90_at`, or `eta_at` if `qos.promise` is P50 or "
            "no P90 is known, later by `qos.may_be_later_s`, or the end of the package's window."
        ),
    ] = None


class Offer(OfferTerms):
    """What one provider offers; its price and time hold if it is accepted before `expires_wall_at`.

    The drones and pads of an offer that `is_held` are kept for the customer until then.
    """

    offer_id: Annotated[OfferId, Field(description="The id of the offer, to accept it with.")]
    expires_wall_at: WallMoment
    packages: Annotated[
        tuple[OfferedPackage, ...], Field(description="When each package is expected.")
    ]
    tariff: Annotated[
        Tariff,
        Field(
            description="The provider's tariff when the offer was made, by which an accepted offer "
            "is booked."
        ),
    ]
    late_share: Annotated[
        float | None,
        Field(
            description="The lateness that nine of ten packages do not exceed, as a share of their "
            "planned time, which is at least 300 s; the booking keeps it. Null if it is not known."
        ),
    ] = None

    def limits(self, hold: OfferHold | None) -> OfferLimits:
        """What a booking of the offer keeps; `hold` is what composition holds for it."""
        return OfferLimits(
            provider_id=self.provider_id,
            price=self.price,
            within_s=self.delivery_time_s,
            hold=hold,
            tariff=self.tariff,
            late_share=self.late_share,
        )


class Quote(JsonModel):
    """The offers for a request, the best first, and why other providers make none.

    One of the offers can be accepted, once.
    """

    quote_id: Annotated[QuoteId, Field(description="The id of the quote.")]
    request: Annotated[
        DeliveryRequest,
        Field(description="What was requested, with the nearest station of each place."),
    ]
    places: Annotated[
        tuple[ServedPlace, ...],
        Field(
            description="The places that were requested other than by `station_id`. Offers may "
            "have other stations of them, and name these."
        ),
    ] = ()
    made_at: FleetMoment
    expires_wall_at: WallMoment
    offers: Annotated[tuple[Offer, ...], Field(description="the best first")]
    infeasible: Annotated[
        tuple[ProviderReason, ...], Field(description="Why other providers make no offer.")
    ]
    taken_offer_id: Annotated[
        OfferId | None, Field(description="The accepted offer; null while none is accepted.")
    ] = None
    delivery_id: Annotated[
        DeliveryId | None,
        Field(description="The delivery of the accepted offer; null while none is accepted."),
    ] = None

    @computed_field(  # type: ignore[prop-decorator]
        description="False for what belongs to a test account."
    )
    @property
    def livemode(self) -> bool:
        """Whether it is real."""
        return is_live_id(self.quote_id)

    def request_of(self, offer: Offer) -> DeliveryRequest:
        """The request with the stations of an offer."""
        ends = {each.package_id: each.destination_station_id for each in offer.packages}
        packages = (
            package.model_copy(update={"destination": Place(station_id=ends[package.package_id])})
            for package in self.request.packages
        )
        pickup = Place(station_id=offer.pickup_station_id)
        return self.request.model_copy(update={"pickup": pickup, "packages": tuple(packages)})

    def places_of(self, offer: Offer) -> tuple[ServedPlace, ...]:
        """The places with the stations of an offer."""
        return tuple(each.served_in(self.request_of(offer)) for each in self.places)

    def number_of(self, offer_id: OfferId) -> int:
        """The place of an offer in the quote, from 0.

        Raises
        ------
        NotFound
            The quote holds no such offer.
        """
        for number, offer in enumerate(self.offers):
            if offer.offer_id == offer_id:
                return number
        raise NotFound("offer", offer_id)


_OFFERS: Final = TypeAdapter(tuple[Offer, ...])
_PLACES: Final = TypeAdapter(tuple[ServedPlace, ...])
_REASONS: Final = TypeAdapter(tuple[ProviderReason, ...])


async def add(
    tx: Tx, quote: Quote, *, customer_id: SubjectId, hold_id: HoldId | None = None
) -> None:
    """Add a new quote; `hold_id` names what composition holds for its offers."""
    row = {
        "quote_id": quote.quote_id,
        "customer_id": customer_id,
        "request": quote.request.model_dump_json(),
        "places": _PLACES.dump_json(quote.places).decode(),
        "offers": _OFFERS.dump_json(quote.offers).decode(),
        "infeasible": _REASONS.dump_json(quote.infeasible).decode(),
        "made_ms": moment_to_ms(quote.made_at),
        "expires_wall_ms": moment_to_ms(quote.expires_wall_at),
        "hold_id": hold_id,
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


async def hold_of(connection: AsyncConnection, quote_id: QuoteId) -> HoldId | None:
    """What composition holds, or held, for the offers of a quote; None if it never did."""
    found = await connection.execute(select(quotes.c.hold_id).where(quotes.c.quote_id == quote_id))
    hold_id: HoldId | None = found.scalar_one_or_none()
    return hold_id


async def has_hold_ended(connection: AsyncConnection, *, after: datetime, until: datetime) -> bool:
    """Whether the hold of a quote ended between two moments of wall time and was not accepted."""
    is_between = quotes.c.expires_wall_ms.between(moment_to_ms(after) + 1, moment_to_ms(until))
    ended = select(quotes.c.quote_id).where(
        quotes.c.hold_id.is_not(None), is_between, quotes.c.taken_offer_id.is_(None)
    )
    return (await connection.execute(ended.limit(1))).first() is not None


async def mark_accepted(
    tx: Tx, quote_id: QuoteId, offer_id: OfferId, *, delivery_id: DeliveryId
) -> bool:
    """Note that an offer is accepted; False when an offer of the quote was accepted before."""
    this = and_(quotes.c.quote_id == quote_id, quotes.c.taken_offer_id.is_(None))
    accepted = {"taken_offer_id": offer_id, "delivery_id": delivery_id}
    return (await tx.execute(update(quotes).where(this).values(accepted))).rowcount == 1


async def delete_expired(tx: Tx, *, before: datetime) -> bool:
    """Delete some quotes that expired before a moment of wall time; whether there may be more."""
    is_old = quotes.c.expires_wall_ms < moment_to_ms(before)
    some = select(quotes.c.quote_id).where(is_old).limit(_DELETED_TOGETHER)
    deleted = await tx.execute(delete(quotes).where(quotes.c.quote_id.in_(some)))
    return deleted.rowcount == _DELETED_TOGETHER


def _quote(row: AnyRow) -> Quote:
    return Quote(
        quote_id=row.quote_id,
        request=DeliveryRequest.read(row.request),
        places=_PLACES.validate_json(row.places),
        made_at=ms_to_moment(row.made_ms),
        expires_wall_at=ms_to_moment(row.expires_wall_ms),
        offers=_OFFERS.validate_json(row.offers),
        infeasible=_REASONS.validate_json(row.infeasible),
        taken_offer_id=row.taken_offer_id,
        delivery_id=row.delivery_id,
    )


async def keep_network(db: Database, stations: NetworkStations) -> None:
    """Store this version of a network in place of an older one."""
    row = {
        "network_id": stations.network_id,
        "version": stations.version,
        "stations": stations.model_dump_json(),
    }
    async with db.write() as tx:
        new = tx.insert(known_networks).values(row)
        await tx.execute(
            new.on_conflict_do_update(
                index_elements=["network_id"],
                set_={name: row[name] for name in ("version", "stations")},
                where=known_networks.c.version < stations.version,
            )
        )


async def read_networks(db: Database) -> Sequence[NetworkStations]:
    """The last known version of each network."""
    async with db.read() as connection:
        found = (await connection.execute(select(known_networks.c.stations))).scalars().all()
    return [NetworkStations.read(each) for each in found]
