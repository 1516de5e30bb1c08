"""A webhook as its customer sees it, and each attempt to notify it."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId, EventId, WebhookId
from skyway.json_model import JsonModel

WebhookUrl = Annotated[str, Field(min_length=1, max_length=2000)]
EventTypes = Annotated[
    tuple[DeliveryEventType, ...], Field(min_length=1, max_length=len(DeliveryEventType))
]
WallTime = Annotated[AwareDatetime, Field(description="RFC 3339 UTC, wall time")]

WebhookState = Literal["ACTIVE", "DISABLED"]
Outcome = Literal["DELIVERED", "FAILED", "GIVEN_UP"]


class NewWebhook(JsonModel):
    """A webhook to add: where to notify the customer, and of which event types."""

    url: WebhookUrl
    event_types: EventTypes | None = None


class WebhookChange(JsonModel):
    """What to change of a webhook; the state ACTIVE enables a disabled webhook again."""

    url: WebhookUrl | None = None
    event_types: EventTypes | None = None
    state: WebhookState | None = None

    @model_validator(mode="after")
    def _url_and_state_are_never_null(self) -> Self:
        for name in ("url", "state"):
            if name in self.model_fields_set and getattr(self, name) is None:
                raise ValueError(f"{name} cannot be null; leave it out to keep it")
        return self


class Webhook(JsonModel):
    """A webhook, without its secret."""

    webhook_id: WebhookId
    url: str
    event_types: tuple[DeliveryEventType, ...] | None
    state: WebhookState
    disabled_reason: str | None
    created_at: WallTime


class IssuedWebhook(Webhook):
    """A new webhook with its signing secret, which is shown only once."""

    secret: str


class WebhookAttempt(JsonModel):
    """One attempt to notify a webhook of an event."""

    attempt_id: str
    event_id: EventId
    event_type: str
    delivery_id: DeliveryId | None
    number: int
    at: WallTime
    duration_ms: int
    outcome: Outcome
    status: int | None
    detail: str | None
    next_try_at: WallTime | None


@dataclass(frozen=True, slots=True)
class Endpoint:
    """What the sender needs of a webhook."""

    webhook_id: WebhookId
    url: str
    secret: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class Notification:
    """One event that is due at one webhook, after this number of attempts."""

    event_id: EventId
    event_type: str
    delivery_id: DeliveryId | None
    attempts: int
    body: bytes


class TrialEvent(JsonModel):
    """The event that a webhook receives when its customer tests it."""

    type: Literal["webhook.test"] = "webhook.test"
    event_id: EventId
    webhook_id: WebhookId
    occurred_at: datetime
