"""One example of each message, as the generated documents show it: one mission, as it goes."""

from typing import Final

from skyway.contracts.delivery_event_examples import delivery_event_examples
from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState, Telemetry
from skyway.contracts.instruction_examples import (
    AT_MCQUEENEY,
    MCQUEENEY,
    MISSION,
    after,
    instruction_examples,
    sent,
)
from skyway.contracts.message import Message
from skyway.contracts.world import ClockAnchor, NetworkVersion, StationState
from skyway.geo import Position
from skyway.ids import InstructionId, NetworkId, PackageId

_SESSION: Final = 1_772_438_400
_ON_THE_WAY: Final = Position(-97.9873, 29.7376)


def message_examples() -> dict[str, Message]:
    """The examples by the name of their message."""
    examples: tuple[Message, ...] = (
        *instruction_examples(),
        _ack(),
        _event(),
        _state(),
        _telemetry(),
        _connection(),
        *delivery_event_examples(),
        _pads(),
        _network(),
        _clock(),
    )
    return {type(example).__name__: example for example in examples}


def _ack() -> Ack:
    return Ack(
        **sent(4, 0),
        session=_SESSION,
        seq=2,
        instruction_id=InstructionId("ins_01"),
        instruction_seq=1,
        stream=1,
        status="ACCEPTED",
    )


def _event() -> DroneEvent:
    return DroneEvent(
        **sent(5, 29),
        session=_SESSION,
        seq=2,
        event="STEP_ENDED",
        stream=1,
        mission_id=MISSION,
        mission_revision=1,
        step_id=2,
        step_kind="FLY",
        started_at=after(5),
        ended_at=after(29),
        station_id=MCQUEENEY,
        position=AT_MCQUEENEY,
        soc=0.41,
        energy_j=1_250_000.0,
        package_ids=(PackageId("p1"),),
    )


def _state() -> DroneState:
    return DroneState(
        **sent(6, 17),
        session=_SESSION,
        seq=9,
        at=after(17),
        activity="FLYING",
        stream=1,
        last_instruction_seq=1,
        last_event_seq=1,
        mission_id=MISSION,
        mission_revision=1,
        step_id=2,
        released_through=3,
        position=_ON_THE_WAY,
        soc=0.7,
        load_kg=2.0,
        package_ids=(PackageId("p1"), PackageId("p2")),
    )


def _telemetry() -> Telemetry:
    return Telemetry(
        **sent(7, 17),
        session=_SESSION,
        seq=720,
        at=after(17),
        position=_ON_THE_WAY,
        soc=0.7,
        power_w=870.0,
        speed_mps=23.0,
    )


def _connection() -> Connection:
    return Connection(
        **sent(8, -60),
        session=_SESSION,
        connection_number=1,
        status="ONLINE",
    )


def _pads() -> StationState:
    return StationState(
        **sent(10, 35),
        station_id=MCQUEENEY,
        pads=2,
        pads_taken=2,
        next_free_at=after(50),
    )


def _network() -> NetworkVersion:
    return NetworkVersion(
        **sent(11, -90),
        network_id=NetworkId("texas"),
        version=3,
        sha256="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        href="/v1/networks/texas",
    )


def _clock() -> ClockAnchor:
    return ClockAnchor(**sent(12, 0), fleet_at=after(0), wall_at=after(0), rate=120.0)
