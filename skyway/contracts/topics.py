"""Every MQTT topic of Skyway, one line each: the source of AsyncAPI, schemas and broker rules.

A topic is a template of names, the message on it, who writes it and who reads it.
"""

from dataclasses import dataclass, field
from typing import Any, Final, Generic, Literal, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState, Telemetry
from skyway.contracts.instruction import AnyInstruction, Instruction
from skyway.contracts.world import ClockAnchor, NetworkVersion, StationState
from skyway.json_text import STANDS_TWICE, repeated_member

M = TypeVar("M", bound=BaseModel)

#: The holder of a broker account: a kind of client, or one service by its name.
BrokerRole = Literal["drone", "customer", "operator", "gateway", "registry", "composition"]


@dataclass(frozen=True, slots=True)
class Address(Generic[M]):
    """One concrete topic name, on which only its topic's message can be published."""

    topic: "Topic[M]"
    name: str


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """One line of the contract, from which AsyncAPI, schemas and broker rules are generated.

    `template` holds placeholders: `{p}` provider, `{d}` drone, `{c}` customer, others by name.
    """

    template: str
    message: Any  # a model class, or an annotated union of them, which has no common static type
    mqtt_qos: Literal[0, 1]
    retained: bool
    writer: BrokerRole
    readers: tuple[BrokerRole, ...]
    about: str
    #: The largest payload that is read; None without a limit. Our own choice for what drones write:
    #: many times what an honest drone needs.
    most_bytes: int | None = None
    _adapter: TypeAdapter[M] = field(init=False, repr=False, compare=False)
    #: The positions of placeholders and words in the template. Words are compared from the last
    #: one, because most topics differ in it.
    _places: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _words: tuple[tuple[int, str], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        levels = list(enumerate(self.template.split("/")))
        places = tuple(place for place, level in levels if level.startswith("{"))
        words = tuple((place, level) for place, level in levels[::-1] if place not in places)
        object.__setattr__(self, "_adapter", TypeAdapter(self.message))
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_words", words)

    def __call__(self, *ids: str) -> Address[M]:
        """The concrete topic for these ids, in the order of the placeholders."""
        levels = self.template.split("/")
        for place, value in zip(self._places, ids, strict=True):
            levels[place] = value
        return Address(self, "/".join(levels))

    @property
    def everywhere(self) -> str:
        """The filter that matches this topic for all ids."""
        return "/".join("+" if part.startswith("{") else part for part in self.template.split("/"))

    def ids_in(self, name: str) -> tuple[str, ...] | None:
        """The ids in a concrete name; None if the name is not of this topic."""
        levels = name.split("/")
        if len(levels) != len(self._places) + len(self._words):
            return None
        for place, word in self._words:
            if levels[place] != word:
                return None
        return tuple([levels[place] for place in self._places])

    def read(self, payload: bytes) -> M:
        """The message in a payload; fields that this version does not know are ignored.

        Raises
        ------
        ValidationError
            It is no such message, or it is too large; a large payload is not looked into.
        """
        if self.is_too_large(payload):
            values = {"limit": self.most_bytes, "size": len(payload)}
            fault = PydanticCustomError("too_large", "{size} bytes, {limit} are allowed", values)
            raise self._refusal(fault)
        message = self._adapter.validate_json(payload, extra="ignore")
        if (place := repeated_member(payload)) is not None:
            raise self._refusal(PydanticCustomError("twice", STANDS_TWICE), *place)
        return message

    def _refusal(self, fault: PydanticCustomError, *place: str | int) -> ValidationError:
        details = InitErrorDetails(type=fault, loc=place, input=None)
        return ValidationError.from_exception_data(self.template, [details])

    def is_too_large(self, payload: bytes) -> bool:
        """Whether a payload is larger than any message of this topic."""
        return self.most_bytes is not None and len(payload) > self.most_bytes

    def schema(self) -> dict[str, Any]:
        """The JSON Schema of the message."""
        return self._adapter.json_schema(mode="serialization")


INSTRUCTIONS: Final[Topic[AnyInstruction]] = Topic(
    "skyway/v1/{p}/{d}/instructions",
    Instruction,
    mqtt_qos=1,
    retained=False,
    writer="composition",
    readers=("drone", "operator"),
    about="Missions and immediate instructions, in order, repeated until the drone acks.",
)
ACKS: Final[Topic[Ack]] = Topic(
    "skyway/v1/{p}/{d}/acks",
    Ack,
    mqtt_qos=1,
    retained=False,
    writer="drone",
    readers=("composition", "operator"),
    about="RECEIVED, ACCEPTED or REJECTED(code) for each instruction.",
    most_bytes=64 * 1024,
)
EVENTS: Final[Topic[DroneEvent]] = Topic(
    "skyway/v1/{p}/{d}/events",
    DroneEvent,
    mqtt_qos=1,
    retained=False,
    writer="drone",
    readers=("composition", "operator"),
    about="Each step's end or failure, and alarms, with evidence.",
    most_bytes=64 * 1024,
)
STATE: Final[Topic[DroneState]] = Topic(
    "skyway/v1/{p}/{d}/state",
    DroneState,
    mqtt_qos=1,
    retained=True,
    writer="drone",
    readers=("composition", "registry", "operator"),
    about="Snapshot on change and at least every 30 s of wall time.",
    most_bytes=64 * 1024,
)
TELEMETRY: Final[Topic[Telemetry]] = Topic(
    "skyway/v1/{p}/{d}/telemetry",
    Telemetry,
    mqtt_qos=0,
    retained=False,
    writer="drone",
    readers=("composition", "registry", "operator"),
    about="Light samples, fewer when nothing changes.",
    most_bytes=8 * 1024,
)
CONNECTION: Final[Topic[Connection]] = Topic(
    "skyway/v1/{p}/{d}/connection",
    Connection,
    mqtt_qos=1,
    retained=True,
    writer="drone",
    readers=("composition", "registry", "gateway", "operator"),
    about="ONLINE, OFFLINE, and LOST as the last will.",
    most_bytes=8 * 1024,
)
DELIVERY_EVENTS: Final[Topic[DeliveryEvent]] = Topic(
    "skyway/v1/customers/{c}/deliveries/{delivery_id}/events",
    DeliveryEvent,
    mqtt_qos=1,
    retained=False,
    writer="gateway",
    readers=("customer", "operator"),
    about="What happened to a customer's delivery.",
)
STATION_STATE: Final[Topic[StationState]] = Topic(
    "skyway/v1/stations/{s}/state",
    StationState,
    mqtt_qos=1,
    retained=True,
    writer="composition",
    readers=("drone", "customer", "operator", "gateway", "registry"),
    about="Pads taken, and when the next one is free.",
)
NETWORK_VERSION: Final[Topic[NetworkVersion]] = Topic(
    "skyway/v1/networks/{n}/version",
    NetworkVersion,
    mqtt_qos=1,
    retained=True,
    writer="composition",
    readers=("drone", "customer", "operator", "gateway", "registry"),
    about="Version, hash and link of a network.",
)
CLOCK: Final[Topic[ClockAnchor]] = Topic(
    "skyway/v1/clock",
    ClockAnchor,
    mqtt_qos=1,
    retained=True,
    writer="gateway",
    readers=("drone", "customer", "operator", "composition", "registry"),
    about="The fleet clock's anchor.",
)

#: All topics; Any because each has a message type of its own.
TOPICS: Final[tuple[Topic[Any], ...]] = (
    INSTRUCTIONS,
    ACKS,
    EVENTS,
    STATE,
    TELEMETRY,
    CONNECTION,
    DELIVERY_EVENTS,
    STATION_STATE,
    NETWORK_VERSION,
    CLOCK,
)
