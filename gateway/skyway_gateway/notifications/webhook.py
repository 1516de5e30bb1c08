"""A webhook as its customer sees it, how a notification is signed, and when it is tried again."""

import base64
import hashlib
import hmac
import json
import random
import re
import secrets
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Annotated, Final, Literal

from pydantic import Field, computed_field

from skyway.bounds import Moment, NotNull
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.message import FleetMoment, Message
from skyway.contracts.statement_event import StatementEventType
from skyway.ids import DeliveryId, EventId, SubjectId, WebhookId, is_live_id
from skyway.json_model import JsonModel

WebhookUrl = Annotated[str, Field(min_length=1, max_length=2000)]
#: What a webhook can be notified of.
WebhookEventType = DeliveryEventType | StatementEventType
EventTypes = Annotated[
    tuple[WebhookEventType, ...], Field(min_length=1, max_length=len(DeliveryEventType) + 1)
]
WallTime = Annotated[Moment, Field(description="RFC 3339 UTC, wall time")]

WebhookState = Literal["ACTIVE", "DISABLED"]
Outcome = Literal["DELIVERED", "FAILED", "GIVEN_UP"]

_SECRET_PREFIX: Final = "whsec_"  # noqa: S105  a public prefix
#: The specification asks for 24 to 64 bytes.
_SECRET_BYTES: Final = 32

_MINUTE_S: Final = 60.0
_HOUR_S: Final = 3600.0

#: Seconds of wall time between two attempts; after the last attempt the notification is given up.
_PAUSES_S: Final = (
    5.0,
    30.0,
    2 * _MINUTE_S,
    15 * _MINUTE_S,
    _HOUR_S,
    3 * _HOUR_S,
    6 * _HOUR_S,
    12 * _HOUR_S,
    24 * _HOUR_S,
)

#: Pauses vary by this share, so that notifications that failed together are not repeated together.
_JITTER: Final = 0.2

#: The longest pause, seconds of wall time.
LONGEST_PAUSE_S: Final = max(_PAUSES_S) * (1 + _JITTER)

#: All attempts of one notification.
MOST_ATTEMPTS: Final = len(_PAUSES_S) + 1


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

    url: Annotated[WebhookUrl | None, NotNull, Field(description="The new URL.")] = None
    event_types: Annotated[
        EventTypes | None, Field(description="The new event types; null for all of them.")
    ] = None
    state: Annotated[
        WebhookState | None,
        NotNull,
        Field(description="ACTIVE enables the webhook again, DISABLED stops it."),
    ] = None


class Webhook(JsonModel):
    """A webhook, without its secret."""

    webhook_id: Annotated[WebhookId, Field(description="The id of the webhook.")]
    url: Annotated[str, Field(description="Where to notify.")]
    event_types: Annotated[
        tuple[WebhookEventType, ...] | None,
        Field(description="Which events are sent; null for all of them."),
    ]
    state: Annotated[WebhookState, Field(description="Whether the webhook is notified.")]
    disabled_reason: Annotated[
        str | None, Field(description="Why it is disabled; null while it is active.")
    ]
    created_wall_at: WallTime
    last_outcome: Annotated[
        Outcome | None,
        Field(
            description="How the newest attempt to notify it went; null before the first. FAILED "
            "and GIVEN_UP say that the receiver did not answer 2xx."
        ),
    ] = None

    @computed_field(  # type: ignore[prop-decorator]
        description="False for what belongs to a test account."
    )
    @property
    def livemode(self) -> bool:
        """Whether it is real."""
        return is_live_id(self.webhook_id)


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
        DeliveryId | None,
        Field(description="The delivery of the event; null for a test event or a statement."),
    ]
    number: Annotated[int, Field(description="The number of this attempt at this event, from 1.")]
    wall_at: WallTime
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
        int | None,
        Field(
            description="The class of the answer's HTTP status: 200, 300, 400 or 500; null without "
            "an answer."
        ),
    ]
    detail: Annotated[str | None, Field(description="What went wrong; null on success.")]
    next_try_wall_at: Annotated[
        WallTime | None,
        Field(description="When the next attempt follows, wall time; null when none follows."),
    ]


@dataclass(frozen=True, slots=True)
class Endpoint:
    """What the sender needs of a webhook."""

    webhook_id: WebhookId
    customer_id: SubjectId
    url: str
    #: As they are stored: the present one first, and then those of rotations that still sign.
    stored_secrets: tuple[str, ...] = field(repr=False)


@dataclass(frozen=True, slots=True)
class Notification:
    """One event that is due at one webhook, after this number of attempts."""

    event_id: EventId
    event_type: str
    delivery_id: DeliveryId | None
    attempts: int
    body: bytes

    @property
    def traceparent(self) -> str | None:
        """The traceparent of the event, as its body has it."""
        found = json.loads(self.body).get("traceparent")
        return found if isinstance(found, str) else None


class TrialData(JsonModel):
    """What a test event says."""

    webhook_id: Annotated[WebhookId, Field(description="The webhook that is tested.")]


class TrialEvent(Message):
    """The event that a webhook receives when its customer tests it, with the members of all events.

    There is no such delivery.
    """

    event_id: Annotated[
        EventId, Field(description="The id of the event, which is also the `webhook-id` header.")
    ]
    type: Annotated[Literal["webhook.test"], Field(description="The type of the event.")]
    delivery_id: Annotated[
        Literal["webhook-test"], Field(description="Stands for a delivery: there is none.")
    ] = "webhook-test"
    livemode: Annotated[bool, Field(description="False for the webhook of a test account.")] = True
    sequence: Annotated[int, Field(ge=1, le=1, description="Always 1.")] = 1
    occurred_at: Annotated[FleetMoment, Field(description="When it was sent, fleet time.")]
    data: Annotated[TrialData, Field(description="What the event says.")]


def new_webhook_secret() -> str:
    """A new signing secret in the form that libraries of Standard Webhooks expect."""
    return _SECRET_PREFIX + base64.b64encode(secrets.token_bytes(_SECRET_BYTES)).decode()


def signing_key(secret: str) -> bytes:
    """The bytes of a signing secret.

    Raises
    ------
    ValueError
        It is not a secret that `new_webhook_secret` makes.
    """
    key = base64.b64decode(secret.removeprefix(_SECRET_PREFIX), validate=True)
    if len(key) != _SECRET_BYTES or not secret.startswith(_SECRET_PREFIX):
        raise ValueError(f"a signing secret has {_SECRET_BYTES} bytes, not {len(key)}")
    return key


def signed_headers(
    secrets_in_use: tuple[str, ...], *, webhook_id: str, at: datetime, body: bytes
) -> dict[str, str]:
    """The three headers that prove the sender, the message and its age to a receiver.

    There is one signature for each secret: a receiver has one of them.
    """
    timestamp = str(int(at.timestamp()))
    signed = f"{webhook_id}.{timestamp}.".encode() + body
    return {
        "webhook-id": webhook_id,
        "webhook-timestamp": timestamp,
        "webhook-signature": " ".join(_signature(secret, signed) for secret in secrets_in_use),
    }


def _signature(secret: str, signed: bytes) -> str:
    digest = hmac.digest(signing_key(secret), signed, hashlib.sha256)
    return f"v1,{base64.b64encode(digest).decode()}"


def pause_s(attempts: int, chance: random.Random, *, asked_s: float = 0.0) -> float | None:
    """Seconds until the next attempt after so many failed ones; None when there is none.

    It is no sooner than the receiver has asked for.
    """
    if attempts >= MOST_ATTEMPTS:
        return None
    return max(asked_s, _PAUSES_S[attempts - 1] * chance.uniform(1 - _JITTER, 1 + _JITTER))


def asked_pause_s(retry_after: str | None, now: datetime) -> float:
    """Seconds that a `Retry-After` asks for, as a number or a date; 0 if it cannot be read.

    At most as long as the longest pause of our own: nobody can make us wait for ever.
    """
    try:
        if retry_after is None or re.fullmatch("[0-9]+", retry_after):
            asked_s = float(retry_after or 0)
        else:
            moment = parsedate_to_datetime(retry_after)
            asked_s = (moment.replace(tzinfo=moment.tzinfo or UTC) - now).total_seconds()
    except (ValueError, OverflowError):
        return 0.0
    return min(max(asked_s, 0.0), _PAUSES_S[-1])
