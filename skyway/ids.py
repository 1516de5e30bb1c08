"""The identifiers of Skyway: one type each, and how a server mints a new one."""

from typing import Annotated, NewType

from pydantic import StringConstraints

#: What every identifier looks like on every wire (docs/reference/rest.md).
_Identifier = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")
]

StationId = NewType("StationId", _Identifier)
NetworkId = NewType("NetworkId", _Identifier)
ZoneId = NewType("ZoneId", _Identifier)
DroneModelId = NewType("DroneModelId", _Identifier)
ProviderId = NewType("ProviderId", _Identifier)
DroneId = NewType("DroneId", _Identifier)
DeliveryId = NewType("DeliveryId", _Identifier)
MissionId = NewType("MissionId", _Identifier)
InstructionId = NewType("InstructionId", _Identifier)
PackageId = NewType("PackageId", _Identifier)
KeyId = NewType("KeyId", _Identifier)
SubjectId = NewType("SubjectId", _Identifier)
WebhookId = NewType("WebhookId", _Identifier)
EventId = NewType("EventId", _Identifier)
QuoteId = NewType("QuoteId", _Identifier)
OfferId = NewType("OfferId", _Identifier)
ClosureId = NewType("ClosureId", _Identifier)
AlarmId = NewType("AlarmId", _Identifier)

_CROCKFORD = "0123456789abcdefghjkmnpqrstvwxyz"


def sortable_id(prefix: str, *, unix_ms: int, entropy: int) -> str:
    """An identifier that sorts by its moment of minting: prefix, 48 bits of time, 80 of chance.

    The layout is ULID's, in lower case so that it can stand in a topic, a path and a host name.
    """
    number = (unix_ms << 80) | (entropy & ((1 << 80) - 1))
    digits = (_CROCKFORD[(number >> shift) & 31] for shift in range(125, -1, -5))
    return f"{prefix}_{''.join(digits)}"
