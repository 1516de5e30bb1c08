"""Facts that several services store about the same things; `skyway verify` compares them.

Each service writes its facts sorted by their keys. A fact says what its service has stored, and
what is still on its way from there to another service.
"""

import hashlib
import json
from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.mission import MissionState
from skyway.delivery.offer import Price
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId
from skyway.json_model import WireModel


class CustodyLink(WireModel):
    """One custodian of a package, in the order of the chain."""

    kind: Literal["STATION", "DRONE", "RECIPIENT"]
    custodian_id: str
    mission_id: Annotated[
        MissionId | None, Field(description="The mission that passed it on, where it is known.")
    ] = None


class PackageFacts(WireModel):
    """A package of a delivery, and its custodians."""

    package_id: PackageId
    chain: tuple[CustodyLink, ...]

    @property
    def recipient(self) -> CustodyLink | None:
        """The link to the recipient; None if the package is not delivered."""
        return next((link for link in self.chain if link.kind == "RECIPIENT"), None)

    @property
    def drones(self) -> frozenset[str]:
        """The drones that had the package."""
        return frozenset(link.custodian_id for link in self.chain if link.kind == "DRONE")


class MissionFacts(WireModel):
    """A mission of a delivery."""

    mission_id: MissionId
    attempt: int
    trip: int
    provider_id: ProviderId
    drone_id: DroneId
    state: MissionState
    price: Price
    report_seq: Annotated[int, Field(description="The last report that was sent or applied.")]
    waiting_reports: Annotated[
        int, Field(description="How many of the last reports are still on their way.")
    ] = 0
    tries: Annotated[
        int, Field(description="How often the first of these was sent without success.")
    ] = 0


class DeliveryFacts(WireModel):
    """A delivery, by gateway or composition."""

    delivery_id: DeliveryId
    is_over: Annotated[bool, Field(description="Whether nothing will be booked any more.")]
    is_queued: Annotated[bool, Field(description="Whether a booking may be under way.")] = False
    is_leaving: Annotated[
        bool, Field(description="Whether it is being deleted, at composition first.")
    ] = False
    waiting_messages: Annotated[
        int, Field(description="How many messages about it are on their way to composition.")
    ] = 0
    missions: tuple[MissionFacts, ...] = ()
    packages: tuple[PackageFacts, ...] = ()

    @property
    def key(self) -> str:
        """The key by which facts are sorted and compared."""
        return self.delivery_id


class HintFacts(WireModel):
    """A mission that makes its drone busy, by composition or the registry."""

    mission_id: MissionId
    drone_id: DroneId
    state: MissionState
    is_live: bool
    report_seq: Annotated[int, Field(description="The last report that was sent or stored.")]
    waiting_reports: Annotated[
        int, Field(description="How many reports are on their way to the registry.")
    ] = 0

    @property
    def key(self) -> str:
        """The key by which facts are sorted and compared."""
        return self.mission_id


class DroneFacts(WireModel):
    """A drone that is registered, or that flies a live mission."""

    drone_id: DroneId
    provider_id: ProviderId

    @property
    def key(self) -> str:
        """The key by which facts are sorted and compared."""
        return self.drone_id


class ProviderFacts(WireModel):
    """A provider that is registered, or that has a key."""

    provider_id: ProviderId

    @property
    def key(self) -> str:
        """The key by which facts are sorted and compared."""
        return self.provider_id


class CopyFacts(WireModel):
    """A value that two services store, under a kind and an id, such as `network texas`."""

    key: Annotated[str, Field(description="The kind and the id, by which facts are compared.")]
    number: Annotated[int | None, Field(description="A version or moment that only grows.")] = None
    text: Annotated[str | None, Field(description="What belongs to this number.")] = None


def stations_hash(places: Iterable[tuple[str, float, float]]) -> str | None:
    """The hash of stations with their longitudes and latitudes; None without stations."""
    text = json.dumps(sorted(places))
    return None if text == "[]" else hashlib.sha256(text.encode()).hexdigest()


AnyFacts = DeliveryFacts | HintFacts | DroneFacts | ProviderFacts | CopyFacts
