"""One example of each message, as the generated documents show it: one mission, as it goes."""

from datetime import UTC, datetime, timedelta
from typing import Final

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState, Telemetry
from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.contracts.instruction import CancelInstruction, MissionInstruction, ReportInstruction
from skyway.contracts.message import Message
from skyway.contracts.world import ClockAnchor, NetworkVersion, StationState
from skyway.geo import Position
from skyway.ids import (
    DeliveryId,
    EventId,
    InstructionId,
    MissionId,
    NetworkId,
    PackageId,
    StationId,
)

_START: Final = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)
_TRACEPARENT: Final = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"
_SESSION: Final = 1_772_438_400
_MISSION: Final = MissionId("mis_01")
_DELIVERY: Final = DeliveryId("del_01")
_SAN_MARCOS: Final = StationId("san-marcos")
_MCQUEENEY: Final = StationId("mcqueeney")
_AT_SAN_MARCOS: Final = Position(-97.9414, 29.8833)
_AT_MCQUEENEY: Final = Position(-98.0331, 29.5919)
_ON_THE_WAY: Final = Position(-97.9873, 29.7376)


def message_examples() -> dict[str, Message]:
    """The examples by the name of their message."""
    examples: tuple[Message, ...] = (
        _mission(),
        _cancel(),
        _report(),
        _ack(),
        _event(),
        _state(),
        _telemetry(),
        _connection(),
        _delivered(),
        _pads(),
        _network(),
        _clock(),
    )
    return {type(example).__name__: example for example in examples}


def _after(minutes: float) -> datetime:
    return _START + timedelta(minutes=minutes)


def _pick_up() -> PickUpStep:
    return PickUpStep(
        step_id=1,
        planned_start_at=_after(5),
        planned_end_at=_after(5),
        station_id=_SAN_MARCOS,
        packages=(
            PackageOnBoard(package_id=PackageId("p1"), mass_kg=0.8),
            PackageOnBoard(package_id=PackageId("p2"), mass_kg=1.2),
        ),
    )


def _fly() -> FlyStep:
    return FlyStep(
        step_id=2,
        planned_start_at=_after(5),
        planned_end_at=_after(29),
        from_id=_SAN_MARCOS,
        to_id=_MCQUEENEY,
        from_position=_AT_SAN_MARCOS,
        to_position=_AT_MCQUEENEY,
        length_m=33_600.0,
        lands=True,
    )


def _wait() -> WaitStep:
    return WaitStep(
        step_id=3,
        planned_start_at=_after(29),
        planned_end_at=_after(35),
        station_id=_MCQUEENEY,
        until_at=_after(35),
    )


def _recharge() -> RechargeStep:
    return RechargeStep(
        step_id=4,
        planned_start_at=_after(35),
        planned_end_at=_after(75),
        station_id=_MCQUEENEY,
        pad=0,
        not_before_at=_after(35),
        until_soc=0.8,
        not_after_at=_after(80),
    )


def _deliver() -> DeliverStep:
    return DeliverStep(
        step_id=5,
        planned_start_at=_after(75),
        planned_end_at=_after(76),
        station_id=_MCQUEENEY,
        package_ids=(PackageId("p1"),),
        dropoff_s=60.0,
    )


def _fly_back() -> FlyStep:
    return FlyStep(
        step_id=6,
        planned_start_at=_after(76),
        planned_end_at=_after(100),
        from_id=_MCQUEENEY,
        to_id=_SAN_MARCOS,
        from_position=_AT_MCQUEENEY,
        to_position=_AT_SAN_MARCOS,
        length_m=33_600.0,
        lands=True,
    )


def _hand_back() -> ReturnStep:
    return ReturnStep(
        step_id=7,
        planned_start_at=_after(100),
        planned_end_at=_after(100),
        station_id=_SAN_MARCOS,
        package_ids=(PackageId("p2"),),
    )


def _mission() -> MissionInstruction:
    return MissionInstruction(
        message_id="msg_01",
        sent_at=_after(0),
        traceparent=_TRACEPARENT,
        instruction_id=InstructionId("ins_01"),
        stream=1,
        seq=1,
        expires_at=_after(1),
        mission_id=_MISSION,
        mission_revision=1,
        delivery_id=_DELIVERY,
        first_step=1,
        steps=(
            _pick_up(),
            _fly(),
            _wait(),
            _recharge(),
            _deliver(),
            _fly_back(),
            _hand_back(),
        ),
    )


def _cancel() -> CancelInstruction:
    return CancelInstruction(
        message_id="msg_02",
        sent_at=_after(2),
        instruction_id=InstructionId("ins_02"),
        stream=1,
        seq=2,
        expires_at=_after(3),
        mission_id=_MISSION,
        mission_revision=2,
        reason="the customer cancelled",
    )


def _report() -> ReportInstruction:
    return ReportInstruction(
        message_id="msg_03",
        sent_at=_after(30),
        instruction_id=InstructionId("ins_03"),
        stream=1,
        seq=3,
        events_confirmed_seq=4,
        expires_at=_after(31),
        events_after_seq=4,
    )


def _ack() -> Ack:
    return Ack(
        message_id="msg_04",
        sent_at=_after(0),
        session=_SESSION,
        seq=2,
        instruction_id=InstructionId("ins_01"),
        instruction_seq=1,
        stream=1,
        status="ACCEPTED",
    )


def _event() -> DroneEvent:
    return DroneEvent(
        message_id="msg_05",
        sent_at=_after(29),
        session=_SESSION,
        seq=2,
        event="STEP_ENDED",
        stream=1,
        mission_id=_MISSION,
        mission_revision=1,
        step_id=2,
        step_kind="FLY",
        started_at=_after(5),
        ended_at=_after(29),
        station_id=_MCQUEENEY,
        position=_AT_MCQUEENEY,
        soc=0.41,
        energy_j=1_250_000.0,
        package_ids=(PackageId("p1"),),
    )


def _state() -> DroneState:
    return DroneState(
        message_id="msg_06",
        sent_at=_after(17),
        session=_SESSION,
        seq=9,
        at=_after(17),
        activity="FLYING",
        stream=1,
        last_instruction_seq=1,
        last_event_seq=1,
        mission_id=_MISSION,
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
        message_id="msg_07",
        sent_at=_after(17),
        session=_SESSION,
        seq=720,
        at=_after(17),
        position=_ON_THE_WAY,
        soc=0.7,
        power_w=870.0,
        speed_mps=23.0,
    )


def _connection() -> Connection:
    return Connection(
        message_id="msg_08",
        sent_at=_after(-60),
        session=_SESSION,
        connection_number=1,
        status="ONLINE",
    )


def _delivered() -> DeliveryEvent:
    return DeliveryEvent(
        message_id="msg_09",
        sent_at=_after(76),
        traceparent=_TRACEPARENT,
        event_id=EventId("evt_01"),
        type=DeliveryEventType.PACKAGE_DELIVERED,
        delivery_id=_DELIVERY,
        sequence=6,
        occurred_at=_after(76),
        data={"package_id": "p1", "station_id": _MCQUEENEY},
    )


def _pads() -> StationState:
    return StationState(
        message_id="msg_10",
        sent_at=_after(35),
        station_id=_MCQUEENEY,
        pads=2,
        pads_taken=2,
        next_free_at=_after(50),
    )


def _network() -> NetworkVersion:
    return NetworkVersion(
        message_id="msg_11",
        sent_at=_after(-90),
        network_id=NetworkId("texas"),
        version=3,
        sha256="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        href="/v1/networks/texas",
    )


def _clock() -> ClockAnchor:
    return ClockAnchor(
        message_id="msg_12", sent_at=_after(0), fleet_at=_after(0), wall_at=_after(0), rate=120.0
    )
