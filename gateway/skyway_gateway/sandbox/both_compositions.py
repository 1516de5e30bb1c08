"""Composition for deliveries of both modes: how a delivery's id begins says which one is asked."""

from dataclasses import dataclass

from skyway.contracts.forgotten_deliveries import ForgetDeliveries, KeptDeliveries
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
    WithdrawMissions,
)
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, is_live_id
from skyway_gateway.clients import DeliveryComposition


@dataclass(frozen=True, slots=True)
class BothCompositions:
    """`DeliveryComposition` over the real composition and over that of the sandbox."""

    live: DeliveryComposition
    test: DeliveryComposition

    def _of(self, delivery_id: DeliveryId) -> DeliveryComposition:
        return self.live if is_live_id(delivery_id) else self.test

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best plan."""
        return await self._of(delivery_id).book(delivery_id, requested)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Refuse all further bookings of a delivery."""
        return await self._of(delivery_id).close(delivery_id)

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or bring them back."""
        return await self._of(delivery_id).cancel(delivery_id, requested)

    async def withdraw(self, delivery_id: DeliveryId, requested: WithdrawMissions) -> None:
        """Give up the missions of a delivery whose request changes."""
        await self._of(delivery_id).withdraw(delivery_id, requested)

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones have been, are and will be."""
        return await self._of(delivery_id).track(delivery_id)

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete deliveries that ended long ago; those that composition still needs are kept."""
        kept: list[DeliveryId] = []
        for one in (self.live, self.test):
            some = tuple(each for each in asked.delivery_ids if self._of(each) is one)
            if some:
                kept += (await one.forget(ForgetDeliveries(delivery_ids=some))).kept
        return KeptDeliveries(kept=tuple(kept))
