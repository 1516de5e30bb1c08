"""Recognises tracking links, and finds what their pages show."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.track import Track
from skyway.ids import DeliveryId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway_gateway.clients import DeliveryComposition
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.proofs import store as proof_store
from skyway_gateway.proofs.verification import DropoffProof
from skyway_gateway.tracking import link_store
from skyway_gateway.tracking.branding_store import branding_of
from skyway_gateway.tracking.tracked import TrackedDelivery, tracked
from skyway_gateway.tracking_links import TrackingLinks

#: A link ends so long after its delivery, fleet time.
LINK_LASTS: Final = timedelta(hours=24)

#: A withdrawn link ends its open streams so much later at most, wall time.
_CHECKED_EVERY: Final = timedelta(seconds=1)
_MOST_CHECKED: Final = 10_000

#: Who has a link can ask often, and no key says who asks: composition is asked once in this time
#: for what has not changed, wall time.
_ASKED_EVERY: Final = timedelta(seconds=2)
_MOST_TRACKS: Final = 500

#: A delivery and the moment of its last change.
Change = tuple[DeliveryId, datetime]

#: A delivery and the token that is shown for it.
Shown = tuple[DeliveryId, str]


class TrackingPages:
    """Deliveries as their links show them."""

    def __init__(
        self,
        db: Database,
        links: TrackingLinks,
        composition: DeliveryComposition,
        clock: FleetClock,
    ) -> None:
        self._db = db
        self._links = links
        self._composition = composition
        self._clock = clock
        self._cached = AnswerCache(
            self.delivery_of, clock=clock, kept=_CHECKED_EVERY, most=_MOST_CHECKED
        )
        self._tracks = AnswerCache(self._track, clock=clock, kept=_ASKED_EVERY, most=_MOST_TRACKS)

    async def _track(self, asked: Change) -> Track:
        return await self._composition.track(asked[0])

    async def may_follow(self, shown: Shown) -> bool:
        """Whether the link still shows a delivery; asked often, it is looked up once a second."""
        return (self._cached.cached(shown) or await self._cached.ask(shown)) is not None

    async def state_of(self, delivery: Delivery) -> TrackedDelivery:
        """What the page shows of a delivery."""
        track = Track(missions=())
        if delivery.missions:
            asked = delivery.delivery_id, delivery.updated_at
            track = self._tracks.cached(asked) or await self._tracks.ask(asked)
        proofs: Mapping[str, DropoffProof] = {}
        async with self._db.read() as connection:
            shop = await branding_of(connection, delivery.customer_id)
            if delivery.request.needs_proof:
                proofs = await proof_store.of_delivery(connection, delivery.delivery_id)
        now, rate = self._clock.now(), self._clock.rate
        return tracked(delivery, track, proofs=proofs, shop=shop, now=now, rate=rate)

    async def delivery_of(self, shown: Shown) -> Delivery | None:
        """The delivery of a link as it is now; None for a wrong, withdrawn or expired link."""
        delivery_id, token = shown
        async with self._db.read() as connection:
            link = await link_store.link_of(connection, delivery_id)
            is_genuine = self._links.is_genuine(delivery_id, token, number=link.number)
            if link.is_withdrawn or not is_genuine:
                return None
            delivery = await link_store.delivery_named(connection, delivery_id)
            ended_at = await link_store.ended_at(connection, delivery_id)
        is_old = ended_at is not None and self._clock.now() > ended_at + LINK_LASTS
        return None if is_old else delivery
