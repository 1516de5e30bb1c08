"""What an observer from outside knows: requests, customers' events, drones' journals, answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, StationId

CustodyKind = Literal["PICK_UP", "DELIVER", "RETURN"]


@dataclass(frozen=True, slots=True)
class Requested:
    """What a customer requested: the destination of each package."""

    destinations: Mapping[PackageId, StationId]


@dataclass(frozen=True, slots=True)
class Received:
    """An event as it reached a customer; `at_s` is monotonic."""

    event: DeliveryEvent
    at_s: float
    is_signed: bool = True


@dataclass(frozen=True, slots=True)
class CustodyStep:
    """The end of a step in a drone's journal that changed who has packages.

    `is_certain` is False where the drone was restarted within the step and cannot know.
    """

    drone_id: DroneId
    kind: CustodyKind
    mission_id: MissionId
    #: None when the journal does not hold the mission any more.
    delivery_id: DeliveryId | None
    package_ids: tuple[PackageId, ...]
    station_id: StationId | None
    is_certain: bool = True


@dataclass(frozen=True, slots=True)
class FinalAnswer:
    """A delivery as the gateway shows it in the end; `state` is None when it is not known there."""

    state: str | None
    activity: str | None = None
    package_states: Mapping[PackageId, str] = field(default_factory=dict)
    mission_ids: tuple[MissionId, ...] = ()


@dataclass(frozen=True, slots=True)
class Awaited:
    """What an alarm asks operators about a delivery, and the drone that does not report."""

    drone_id: DroneId
    question: str


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that the judgement needs; every mapping is by delivery."""

    accepted: Mapping[DeliveryId, Requested]
    streams: Mapping[DeliveryId, Sequence[Received]]
    webhooks: Mapping[DeliveryId, Sequence[Received]]
    journals: Sequence[CustodyStep]
    answers: Mapping[DeliveryId, FinalAnswer]
    #: Deliveries that wait for an operator's decision.
    awaited: Mapping[DeliveryId, Awaited] = field(default_factory=dict)
    #: Drones whose journals were lost, so that they do not know what they did before.
    forgetful: frozenset[DroneId] = frozenset()
    #: Deliveries whose webhooks failed visibly and are tried again later.
    retried: frozenset[DeliveryId] = frozenset()


#: Any JSON object.
Document = Mapping[str, Any]
