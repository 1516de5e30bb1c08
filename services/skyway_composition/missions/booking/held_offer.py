"""A held offer as it is stored: its trips, and what they were planned with."""

from collections.abc import Iterable
from typing import Final, Self

from pydantic import TypeAdapter

from skyway.contracts.mission import OfferLimits
from skyway.ids import DroneId, NetworkId, PackageId
from skyway.json_model import JsonModel
from skyway_composition.networks.store import Present
from skyway_composition.planning.availability import BookedMission
from skyway_composition.planning.offer import Offer
from skyway_composition.planning.world import World


class HeldOffer(JsonModel):
    """An offer whose drones and pads are held, the network, and the drones' calendars then."""

    network_id: NetworkId
    version: int
    conditions: int
    offer: Offer
    calendars: tuple[BookedMission, ...]

    @classmethod
    def of(cls, offer: Offer, world: World, *, engaged: Iterable[BookedMission]) -> Self:
        """The offer as it was planned in this world, with the calendars as read before."""
        drone_ids = {part.candidate.drone_id for part in offer.parts}
        return cls(
            network_id=world.present.network_id,
            version=world.present.version,
            conditions=world.present.conditions,
            offer=offer,
            calendars=tuple(each for each in engaged if each.drone_id in drone_ids),
        )

    @property
    def present(self) -> Present:
        """Version and conditions of the network with which the offer was planned."""
        return Present(self.network_id, self.version, self.conditions)

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
