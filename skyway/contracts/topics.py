"""Every MQTT topic of Skyway, one line each: the source of AsyncAPI, schemas and broker rules."""

from typing import Any, Final

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState, Telemetry
from skyway.contracts.instruction import AnyInstruction, Instruction
from skyway.contracts.topic import Topic
from skyway.contracts.world import ClockAnchor, NetworkVersion, StationState

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
)
EVENTS: Final[Topic[DroneEvent]] = Topic(
    "skyway/v1/{p}/{d}/events",
    DroneEvent,
    mqtt_qos=1,
    retained=False,
    writer="drone",
    readers=("composition", "operator"),
    about="Each step's end or failure, and alarms, with evidence.",
)
STATE: Final[Topic[DroneState]] = Topic(
    "skyway/v1/{p}/{d}/state",
    DroneState,
    mqtt_qos=1,
    retained=True,
    writer="drone",
    readers=("composition", "registry", "operator"),
    about="Snapshot on change and at least every 30 s of wall time.",
)
TELEMETRY: Final[Topic[Telemetry]] = Topic(
    "skyway/v1/{p}/{d}/telemetry",
    Telemetry,
    mqtt_qos=0,
    retained=False,
    writer="drone",
    readers=("composition", "registry", "operator"),
    about="Light samples, fewer when nothing changes.",
)
CONNECTION: Final[Topic[Connection]] = Topic(
    "skyway/v1/{p}/{d}/connection",
    Connection,
    mqtt_qos=1,
    retained=True,
    writer="drone",
    readers=("composition", "registry", "gateway", "operator"),
    about="ONLINE, OFFLINE, and LOST as the last will.",
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
