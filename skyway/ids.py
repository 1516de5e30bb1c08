"""The identifiers of Skyway: one type for each, and how a server makes a new one."""

from typing import Annotated, Final, NewType

from pydantic import Field, StringConstraints

#: The form of every identifier: 1 to 64 letters, digits, underscores and hyphens.
_FORM = StringConstraints(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")

StationId = NewType("StationId", Annotated[str, _FORM, Field(description="Id of a station.")])
NetworkId = NewType(
    "NetworkId", Annotated[str, _FORM, Field(description="Id of a skyway network.")]
)
ZoneId = NewType("ZoneId", Annotated[str, _FORM, Field(description="Id of a zone.")])
DroneModelId = NewType(
    "DroneModelId", Annotated[str, _FORM, Field(description="Id of a drone model.")]
)
ConnectorId = NewType(
    "ConnectorId",
    Annotated[str, _FORM, Field(description="Name of a connector between drones and pads.")],
)
ProviderId = NewType("ProviderId", Annotated[str, _FORM, Field(description="Id of a provider.")])
DroneId = NewType("DroneId", Annotated[str, _FORM, Field(description="Id of a drone.")])
BatteryId = NewType("BatteryId", Annotated[str, _FORM, Field(description="Id of a battery.")])
DeliveryId = NewType("DeliveryId", Annotated[str, _FORM, Field(description="Id of a delivery.")])
MissionId = NewType("MissionId", Annotated[str, _FORM, Field(description="Id of a mission.")])
InstructionId = NewType(
    "InstructionId", Annotated[str, _FORM, Field(description="Id of an instruction.")]
)
PackageId = NewType(
    "PackageId",
    Annotated[str, _FORM, Field(description="Id of a package, unique within its request.")],
)
KeyId = NewType("KeyId", Annotated[str, _FORM, Field(description="Id of an API key.")])
SubjectId = NewType(
    "SubjectId",
    Annotated[
        str,
        _FORM,
        Field(description="Name of a customer or an operator, or id of a provider or a drone."),
    ],
)
WebhookId = NewType("WebhookId", Annotated[str, _FORM, Field(description="Id of a webhook.")])
EventId = NewType("EventId", Annotated[str, _FORM, Field(description="Id of an event.")])
QuoteId = NewType("QuoteId", Annotated[str, _FORM, Field(description="Id of a quote.")])
OfferId = NewType("OfferId", Annotated[str, _FORM, Field(description="Id of an offer.")])
HoldId = NewType("HoldId", Annotated[str, _FORM, Field(description="Id of held offers.")])
ClosureId = NewType("ClosureId", Annotated[str, _FORM, Field(description="Id of a closure.")])
AlarmId = NewType("AlarmId", Annotated[str, _FORM, Field(description="Id of an alarm.")])
QuarantineId = NewType(
    "QuarantineId", Annotated[str, _FORM, Field(description="Id of a set-aside message.")]
)

#: How the name of a test account begins. The ids of what belongs to a test account have it after
#: their kind: ``dlv_test_01m7...``.
TEST_PREFIX: Final = "test_"


def is_live_account(subject_id: str) -> bool:
    """Whether a subject's calls are real; those of a test account reach the sandbox only."""
    return not subject_id.startswith(TEST_PREFIX)


def is_live_id(identifier: str) -> bool:
    """Whether an id with a kind, such as a delivery's, belongs to a live account."""
    _kind, _, name = identifier.partition("_")
    return is_live_account(name)


def kind_for(subject_id: str, kind: str) -> str:
    """The prefix of a new id of this kind that belongs to this subject."""
    return kind if is_live_account(subject_id) else f"{kind}_{TEST_PREFIX.rstrip('_')}"


_CROCKFORD = "0123456789abcdefghjkmnpqrstvwxyz"


def sortable_id(prefix: str, *, unix_ms: int, entropy: int) -> str:
    """A new identifier that sorts by the moment of its making: prefix, time (48 bits), chance (80).

    The layout is that of a ULID, in lower case, so that it fits topics, paths and host names.
    """
    number = (unix_ms << 80) | (entropy & ((1 << 80) - 1))
    digits = (_CROCKFORD[(number >> shift) & 31] for shift in range(125, -1, -5))
    return f"{prefix}_{''.join(digits)}"
