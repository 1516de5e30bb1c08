"""A message of a drone that was set aside: from whom, why, and what it said."""

import hashlib
import re
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.bounds import printable
from skyway.ids import DroneId, ProviderId, QuarantineId
from skyway.json_model import JsonModel

#: Why a message was not taken.
#: UNREADABLE: it does not have the form of its topic's messages, or a value is out of bounds.
#: AHEAD: it speaks of the future. BEHIND: a state that speaks of long ago. FOREIGN_PROVIDER: its
#: topic names another provider than the drone's. IMPLAUSIBLE: no drone says this. FAILED: handling
#: it failed again and again. FORGED: the drone signs its messages, and this one has no valid
#: signature of the drone.
QuarantineReason = Literal[
    "UNREADABLE", "AHEAD", "BEHIND", "FOREIGN_PROVIDER", "IMPLAUSIBLE", "FAILED", "FORGED"
]

#: The most bytes of a payload that are kept; a state has about 1 KiB. Our own choice.
MOST_PAYLOAD_BYTES: Final = 8_192

#: A PIN that was typed at a drone: a secret, which is not kept here.
_PIN: Final = re.compile(rb'("pin"\s*:\s*")[^"]*')

#: Characters that a terminal obeys instead of showing them.
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


@dataclass(frozen=True, slots=True)
class SetAsideMessage:
    """A message on its way into the quarantine; `payload` holds its first bytes only."""

    topic: str
    provider_id: ProviderId
    drone_id: DroneId
    reason: QuarantineReason
    detail: str
    payload: bytes
    size_bytes: int
    payload_sha256: str

    @classmethod
    def of(
        cls, topic: str, ids: tuple[str, ...], payload: bytes, reason: QuarantineReason, detail: str
    ) -> "SetAsideMessage":
        """The message on this topic, without a PIN; its ids are provider and drone."""
        payload = _PIN.sub(rb"\1***", payload)
        return cls(
            topic=topic,
            provider_id=ProviderId(ids[0]),
            drone_id=DroneId(ids[1]),
            reason=reason,
            detail=str(printable(detail)),
            payload=payload[:MOST_PAYLOAD_BYTES],
            size_bytes=len(payload),
            payload_sha256=hashlib.sha256(payload).hexdigest(),
        )


class QuarantinedMessage(JsonModel):
    """A message of a drone that was not taken."""

    quarantine_id: Annotated[QuarantineId, Field(description="Id of the set-aside message.")]
    reason: Annotated[
        QuarantineReason,
        Field(
            description="UNREADABLE: it has another form, or a value out of bounds. AHEAD: it "
            "speaks of the future. BEHIND: a state that speaks of long ago. FOREIGN_PROVIDER: its "
            "topic names another provider than the drone's. IMPLAUSIBLE: no drone says this. "
            "FAILED: handling it failed again and again. FORGED: the drone signs its "
            "messages, and this one has no valid signature of it."
        ),
    ]
    detail: Annotated[str, Field(description="The reason in words.")]
    topic: Annotated[str, Field(description="Topic on which it arrived.")]
    provider_id: Annotated[ProviderId, Field(description="Provider that its topic names.")]
    drone_id: Annotated[DroneId, Field(description="Drone that sent it.")]
    received_at: Annotated[datetime, Field(description="Moment of its first arrival, fleet time.")]
    last_received_at: Annotated[
        datetime, Field(description="Moment of its last arrival, fleet time.")
    ]
    times: Annotated[int, Field(description="How often the same message was set aside.")]
    payload: Annotated[
        str, Field(description="Its first 8,192 bytes as text; other bytes are shown as \\x...")
    ]
    size_bytes: Annotated[int, Field(description="Size of the whole payload in bytes.")]
    is_whole: Annotated[
        bool, Field(description="Whether the whole payload was kept, so that it can be replayed.")
    ]


def shown_payload(payload: bytes) -> str:
    """The payload as a text that is safe to print; what is no text is written as an escape."""
    text = payload.decode(errors="backslashreplace")
    return _CONTROL.sub(lambda found: f"\\x{ord(found.group()):02x}", text)
