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

    url: Annotated[
        WebhookUrl, Field(description="Where to notify: an http or https URL at a public address.")
    ]
    event_types: Annotated[
        EventTypes | None, Field(description="Which events to send; without this, all of them.")
    ] = None


class WebhookChange(JsonModel):
    """What to change of a webhook; the state ACTIVE enables a disabled webhook again."""

    url: Annotated[WebhookUrl | None, Field(description="The new URL.")] = None
    event_types: Annotated[
        EventTypes | None, Field(description="The new event types; null for all of them.")
    ] = None
    state: Annotated[
        WebhookState | None,
        Field(description="ACTIVE enables the webhook again, DISABLED stops it."),
    ] = None

    @model_validator(mode="after")
    def _url_and_state_are_never_null(self) -> Self:
        for name in ("url", "state"):
            if name in self.model_fields_set and getattr(self, name) is None:
                raise ValueError(f"{name} cannot be null; leave it out to keep it")
        return self


class Webhook(JsonModel):
    """A webhook, without its secret."""

    webhook_id: Annotated[WebhookId, Field(description="The id of the webhook.")]
    url: Annotated[str, Field(description="Where to notify.")]
    event_types: Annotated[
        tuple[DeliveryEventType, ...] | None,
        Field(description="Which events are sent; null for all of them."),
    ]
    state: Annotated[WebhookState, Field(description="Whether the webhook is notified.")]
    disabled_reason: Annotated[
        str | None, Field(description="Why it is disabled; null while it is active.")
    ]
    created_at: WallTime


class IssuedWebhook(Webhook):
    """A new webhook with its signing secret, which is shown only once."""

    secret: Annotated[
        str, Field(description="The signing secret (`whsec_...`); it is shown only once.")
    ]


class WebhookAttempt(JsonModel):
    """One attempt to notify a webhook of an event."""

    attempt_id: Annotated[str, Field(description="The id of the attempt.")]
    event_id: Annotated[
        EventId, Field(description="The event, which is also the `webhook-id` header.")
    ]
    event_type: Annotated[str, Field(description="The type of the event.")]
    delivery_id: Annotated[
        DeliveryId | None, Field(description="The delivery of the event; null for a test event.")
    ]
    number: Annotated[int, Field(description="The number of this attempt at this event, from 1.")]
    at: WallTime
    duration_ms: Annotated[
        int, Field(description="How long the attempt took, milliseconds of wall time.")
    ]
    outcome: Annotated[
        Outcome,
        Field(
            description="DELIVERED, FAILED (another attempt follows) or GIVEN_UP (none follows)."
        ),
    ]
    status: Annotated[
        int | None, Field(description="The HTTP status of the answer; null without an answer.")
    ]
    detail: Annotated[str | None, Field(description="What went wrong; null on success.")]
    next_try_at: Annotated[
        WallTime | None,
        Field(description="When the next attempt follows, wall time; null when none follows."),
    ]


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

    type: Annotated[Literal["webhook.test"], Field(description="The type of the event.")] = (
        "webhook.test"
    )
    event_id: Annotated[
        EventId, Field(description="The id of the event, which is also the `webhook-id` header.")
    ]
    webhook_id: Annotated[WebhookId, Field(description="The webhook that is tested.")]
    occurred_at: Annotated[datetime, Field(description="RFC 3339 UTC, fleet time.")]
