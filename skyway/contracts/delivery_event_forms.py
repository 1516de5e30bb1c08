"""One form for each type of delivery event.

The gateway writes `DeliveryEvent`, whose `data` is any JSON. These models describe the same JSON to
customers; the documents and the JSON Schemas are made from them.
"""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.delivery_event_data import (
    ChangedData,
    CompletedData,
    DelayedData,
    DispatchedData,
    EndedData,
    LoadedData,
    PackageCancelledData,
    PackageDeliveredData,
    PackageReturnedData,
    PackageStrandedData,
    PlannedData,
    PromisedData,
    ProofAwaitedData,
    RejectedData,
    ReplannedData,
    RequestedData,
    ScheduledData,
    StartedData,
)
from skyway.contracts.message import FleetMoment, Message
from skyway.ids import DeliveryId, EventId


class _Event(Message):
    event_id: EventId
    delivery_id: DeliveryId
    livemode: Annotated[
        bool, Field(description="False for a test delivery, which the sandbox has played.")
    ] = True
    sequence: Annotated[
        int, Field(ge=1, description="The event's number within its delivery, without gaps.")
    ]
    occurred_at: Annotated[FleetMoment, Field(description="When it happened, fleet time.")]


_About = Field(description="What happened.")
_Data = Field(description="What the event says.")


class DeliveryRequestedEvent(_Event):
    """A delivery was requested."""

    type: Annotated[Literal["delivery.requested"], _About]
    data: Annotated[RequestedData, _Data]


class DeliveryChangedEvent(_Event):
    """The customer has changed what it said about a delivery."""

    type: Annotated[Literal["delivery.changed"], _About]
    data: Annotated[ChangedData, _Data]


class DeliveryScheduledEvent(_Event):
    """The pickup is far ahead: the delivery waits until its drone may be booked."""

    type: Annotated[Literal["delivery.scheduled"], _About]
    data: Annotated[ScheduledData, _Data]


class DeliveryPlannedEvent(_Event):
    """Drones and pads were booked for packages of a delivery."""

    type: Annotated[Literal["delivery.planned"], _About]
    data: Annotated[PlannedData, _Data]


class DeliveryPromisedEvent(_Event):
    """A promise that was provisional is firm now (`qos.firm_within_s`)."""

    type: Annotated[Literal["delivery.promised"], _About]
    data: Annotated[PromisedData, _Data]


class DeliveryDispatchedEvent(_Event):
    """A drone accepted a mission of a delivery."""

    type: Annotated[Literal["delivery.dispatched"], _About]
    data: Annotated[DispatchedData, _Data]


class DeliveryLoadedEvent(_Event):
    """Packages are on board."""

    type: Annotated[Literal["delivery.loaded"], _About]
    data: Annotated[LoadedData, _Data]


class DeliveryStartedEvent(_Event):
    """The first drone of a delivery has its packages on board."""

    type: Annotated[Literal["delivery.started"], _About]
    data: Annotated[StartedData, _Data]


class DeliveryProofAwaitedEvent(_Event):
    """A drone has come, and hands packages over once their proofs are there."""

    type: Annotated[Literal["delivery.proof_awaited"], _About]
    data: Annotated[ProofAwaitedData, _Data]


class DeliveryDelayedEvent(_Event):
    """Packages come after their `due_at`."""

    type: Annotated[Literal["delivery.delayed"], _About]
    data: Annotated[DelayedData, _Data]


class DeliveryReplannedEvent(_Event):
    """A drone has a new plan."""

    type: Annotated[Literal["delivery.replanned"], _About]
    data: Annotated[ReplannedData, _Data]


class DeliveryCompletedEvent(_Event):
    """All packages were handed over."""

    type: Annotated[Literal["delivery.completed"], _About]
    data: Annotated[CompletedData, _Data]


class DeliveryPartiallyCompletedEvent(_Event):
    """Some packages were handed over, the others will not be."""

    type: Annotated[Literal["delivery.partially_completed"], _About]
    data: Annotated[EndedData, _Data]


class DeliveryFailedEvent(_Event):
    """No package was handed over."""

    type: Annotated[Literal["delivery.failed"], _About]
    data: Annotated[EndedData, _Data]


class DeliveryRejectedEvent(_Event):
    """No provider can fly the delivery."""

    type: Annotated[Literal["delivery.rejected"], _About]
    data: Annotated[RejectedData, _Data]


class DeliveryCancelledEvent(_Event):
    """The customer cancelled the delivery."""

    type: Annotated[Literal["delivery.cancelled"], _About]
    data: Annotated[EndedData, _Data]


class PackageDeliveredEvent(_Event):
    """A package was handed over."""

    type: Annotated[Literal["package.delivered"], _About]
    data: Annotated[PackageDeliveredData, _Data]


class PackageReturnedEvent(_Event):
    """A package is back at the pickup."""

    type: Annotated[Literal["package.returned"], _About]
    data: Annotated[PackageReturnedData, _Data]


class PackageStrandedEvent(_Event):
    """A package will not be delivered; a drone left it where it could land."""

    type: Annotated[Literal["package.stranded"], _About]
    data: Annotated[PackageStrandedData, _Data]


class PackageCancelledEvent(_Event):
    """A package was cancelled before it was loaded."""

    type: Annotated[Literal["package.cancelled"], _About]
    data: Annotated[PackageCancelledData, _Data]


AnyDeliveryEvent = Annotated[
    DeliveryRequestedEvent
    | DeliveryChangedEvent
    | DeliveryScheduledEvent
    | DeliveryPlannedEvent
    | DeliveryPromisedEvent
    | DeliveryDispatchedEvent
    | DeliveryLoadedEvent
    | DeliveryStartedEvent
    | DeliveryProofAwaitedEvent
    | DeliveryDelayedEvent
    | DeliveryReplannedEvent
    | DeliveryCompletedEvent
    | DeliveryPartiallyCompletedEvent
    | DeliveryFailedEvent
    | DeliveryRejectedEvent
    | DeliveryCancelledEvent
    | PackageDeliveredEvent
    | PackageReturnedEvent
    | PackageStrandedEvent
    | PackageCancelledEvent,
    Field(discriminator="type"),
]
