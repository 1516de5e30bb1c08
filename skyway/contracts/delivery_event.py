"""Gateway to customer: what happened to a delivery, the same by webhook, SSE and MQTT."""

from enum import StrEnum
from typing import Annotated, Any

from pydantic import Field

from skyway.contracts.message import FleetMoment, Message
from skyway.ids import DeliveryId, EventId


class DeliveryEventType(StrEnum):
    """The kinds of events that the gateway reports to the customer of a delivery."""

    REQUESTED = "delivery.requested"
    CHANGED = "delivery.changed"
    SCHEDULED = "delivery.scheduled"
    PLANNED = "delivery.planned"
    PROMISED = "delivery.promised"
    DISPATCHED = "delivery.dispatched"
    LOADED = "delivery.loaded"
    STARTED = "delivery.started"
    PROOF_AWAITED = "delivery.proof_awaited"
    DELAYED = "delivery.delayed"
    REPLANNED = "delivery.replanned"
    COMPLETED = "delivery.completed"
    PARTIALLY_COMPLETED = "delivery.partially_completed"
    FAILED = "delivery.failed"
    REJECTED = "delivery.rejected"
    CANCELLED = "delivery.cancelled"
    PACKAGE_DELIVERED = "package.delivered"
    PACKAGE_RETURNED = "package.returned"
    PACKAGE_STRANDED = "package.stranded"
    PACKAGE_CANCELLED = "package.cancelled"


class DeliveryEvent(Message):
    """One event; `sequence` counts from 1 per delivery, without gaps."""

    event_id: EventId
    type: DeliveryEventType
    delivery_id: DeliveryId
    livemode: Annotated[
        bool, Field(description="False for a test delivery, which the sandbox has played.")
    ] = True
    sequence: Annotated[int, Field(ge=1)]
    occurred_at: FleetMoment
    data: dict[str, Any] = Field(default_factory=dict)
