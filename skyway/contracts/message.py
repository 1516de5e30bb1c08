"""What every MQTT message carries."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.bounds import Count, Moment, Words
from skyway.json_model import WireModel

FleetMoment = Annotated[Moment, Field(description="RFC 3339 UTC, fleet time")]
WallMoment = Annotated[Moment, Field(description="RFC 3339 UTC, wall time")]
Soc = Annotated[float, Field(ge=0.0, le=1.0, description="state of charge")]


class Message(WireModel):
    """The envelope of every message; `sent_at` is fleet time at the writer."""

    # Not a constant: generators of clients make warnings of numbers as constants.
    schema_version: Annotated[
        int, Field(ge=1, le=1, description="The version of this message's schema.")
    ] = 1
    message_id: Annotated[Words, Field(description="Id of the message.")]
    sent_at: FleetMoment
    traceparent: Annotated[
        Words | None, Field(description="The W3C trace context of what led to the message.")
    ] = None


class DroneMessage(Message):
    """A message by a drone, ordered by (session, seq) within its topic.

    `session` is max(the journal's last + 1, wall-clock seconds at boot).
    """

    session: Annotated[Count, Field(description="The drone's session; it grows with every boot.")]
    seq: Annotated[
        Count, Field(description="The number of the message within its topic and session.")
    ]


def is_newer(candidate: tuple[int, int], known: tuple[int, int] | None) -> bool:
    """Whether a drone's pair (session, seq) comes after the last one that was read."""
    return known is None or candidate > known


def utc_text(moment: datetime) -> str:
    """A moment as RFC 3339 text with millisecond precision."""
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
