"""The hard limits of what may be offered: the customer's, and those of an offer once taken."""

from dataclasses import dataclass, replace
from typing import Self

from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import QoS
from skyway.units import moment_to_ms

#: Milliseconds by which an offer's delivery time may be exceeded: it was rounded on its way.
_OFFER_SLACK_MS = 1_000


@dataclass(frozen=True, slots=True)
class Limits:
    """The latest moment of the last delivery, and the highest price; None without limit.

    Unless `is_whole`, some of the packages may be left for later when there are too few drones.
    """

    latest_ms: int | None
    max_price: int | None
    is_whole: bool

    @classmethod
    def of(cls, qos: QoS) -> Self:
        """The limits that a customer gives; within a price all is carried, or nothing."""
        latest_ms = None if qos.deadline_at is None else moment_to_ms(qos.deadline_at)
        return cls(latest_ms, qos.max_price, is_whole=qos.max_price is not None)

    @classmethod
    def of_whole(cls, qos: QoS) -> Self:
        """The limits that a customer gives for all packages or none."""
        return replace(cls.of(qos), is_whole=True)

    def within(self, offer: OfferLimits | None, *, start_ms: int) -> "Limits":
        """These limits and those of an offer, for missions that begin at this moment."""
        if offer is None:
            return self
        latest_ms = start_ms + round(offer.within_s * 1000) + _OFFER_SLACK_MS
        amounts = (self.max_price, offer.price.amount)
        return Limits(
            latest_ms if self.latest_ms is None else min(self.latest_ms, latest_ms),
            min(each for each in amounts if each is not None),
            is_whole=True,
        )
