"""The shared trips that booking can join; `missions.queue` finds them."""

from typing import Protocol

from skyway.contracts.mission import BookMissions, Mission
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Tx
from skyway_composition.context import Context
from skyway_composition.planning.offer import Offers


class SharedTrip(Protocol):
    """A trip that a request shares with the waiting mission of another delivery."""

    async def join(self, context: Context, tx: Tx) -> Mission:
        """Save it; returns the request's mission. `WorldChanged`: it must be planned again."""


class SharedTrips(Protocol):
    """Finds shared trips."""

    async def find(
        self, delivery_id: DeliveryId, requested: BookMissions, offers: Offers
    ) -> SharedTrip | None:
        """The best shared trip; None if an offer is better."""
