"""One example of each instruction, all for one mission."""

from datetime import UTC, datetime, timedelta
from typing import Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    HoldInstruction,
    MissionInstruction,
    ReportInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway.geo import Position
from skyway.ids import DeliveryId, InstructionId, MissionId, PackageId, StationId

START: Final = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)
TRACEPARENT: Final = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"
MISSION: Final = MissionId("mis_01")
DELIVERY: Final = DeliveryId("del_01")
SAN_MARCOS: Final = StationId("san-marcos")
MCQUEENEY: Final = StationId("mcqueeney")
AT_SAN_MARCOS: Final = Position(-97.9414, 29.8833)
AT_MCQUEENEY: Final = Position(-98.0331, 29.5919)


def instruction_examples() -> tuple[AnyInstruction, ...]:
    """An example of each kind."""
    return (_mission(), _divert(), _return_home(), _hold(), _resume(), _cancel(), _report())


def after(minutes: float) -> datetime:
    """So many minutes after the examples' mission was sent."""
    return START + timedelta(minutes=minutes)


def _pick_up() -> PickUpStep:
    return PickUpStep(
        step_id=1,
        planned_start_at=after(5),
        planned_end_at=after(5),
        station_id=SAN_MARCOS,
        packages=(
            PackageOnBoard(package_id=PackageId("p1"), mass_kg=0.8),
            PackageOnBoard(package_id=PackageId("p2"), mass_kg=1.2),
        ),
    )


def _fly() -> FlyStep:
    return FlyStep(
        step_id=2,
        planned_start_at=after(5),
        planned_end_at=after(29),
        from_id=SAN_MARCOS,
        to_id=MCQUEENEY,
        from_position=AT_SAN_MARCOS,
        to_position=AT_MCQUEENEY,
        length_m=33_600.0,
        lands=True,
    )


def _wait() -> WaitStep:
    return WaitStep(
        step_id=3,
        planned_start_at=after(29),
        planned_end_at=after(35),
        station_id=MCQUEENEY,
        until_at=after(35),
    )


def _recharge() -> RechargeStep:
    return RechargeStep(
        step_id=4,
        planned_start_at=after(35),
        planned_end_at=after(75),
        station_id=MCQUEENEY,
        pad=0,
        not_before_at=after(35),
        until_soc=0.8,
        not_after_at=after(80),
    )


def _deliver() -> DeliverStep:
    return DeliverStep(
        step_id=5,
        planned_start_at=after(75),
        planned_end_at=after(76),
        station_id=MCQUEENEY,
        package_ids=(PackageId("p1"),),
        dropoff_s=60.0,
    )


def _fly_back() -> FlyStep:
    return FlyStep(
        step_id=6,
        planned_start_at=after(76),
        planned_end_at=after(100),
        from_id=MCQUEENEY,
        to_id=SAN_MARCOS,
        from_position=AT_MCQUEENEY,
        to_position=AT_SAN_MARCOS,
        length_m=33_600.0,
        lands=True,
    )


def _hand_back() -> ReturnStep:
    return ReturnStep(
        step_id=7,
        planned_start_at=after(100),
        planned_end_at=after(100),
        station_id=SAN_MARCOS,
        package_ids=(PackageId("p2"),),
    )


def _mission() -> MissionInstruction:
    return MissionInstruction(
        message_id="msg_01",
        sent_at=after(0),
        traceparent=TRACEPARENT,
        instruction_id=InstructionId("ins_01"),
        stream=1,
        seq=1,
        expires_at=after(1),
        mission_id=MISSION,
        mission_revision=1,
        delivery_id=DELIVERY,
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


def _divert() -> DivertInstruction:
    """Mcqueeney has closed: the drone on its way there flies over it."""
    return DivertInstruction(
        message_id="msg_13",
        sent_at=after(17),
        traceparent=TRACEPARENT,
        instruction_id=InstructionId("ins_04"),
        stream=1,
        seq=4,
        expires_at=after(18),
        mission_id=MISSION,
        mission_revision=2,
        delivery_id=DELIVERY,
        last_valid_step=2,
        steps=(
            _fly_back().model_copy(
                update={
                    "step_id": 3,
                    "planned_start_at": after(28.5),
                    "planned_end_at": after(52.5),
                }
            ),
            _hand_back().model_copy(
                update={
                    "step_id": 4,
                    "planned_start_at": after(52.5),
                    "planned_end_at": after(52.5),
                    "package_ids": (PackageId("p1"), PackageId("p2")),
                }
            ),
        ),
        reason="STATION_CLOSED: mcqueeney",
    )


def _return_home() -> ReturnHomeInstruction:
    """The drone is called home while it charges: the RECHARGE under way ends immediately."""
    return ReturnHomeInstruction(
        message_id="msg_14",
        sent_at=after(60),
        instruction_id=InstructionId("ins_05"),
        stream=1,
        seq=5,
        expires_at=after(61),
        mission_id=MISSION,
        mission_revision=2,
        delivery_id=DELIVERY,
        last_valid_step=3,
        steps=(
            _fly_back().model_copy(
                update={
                    "step_id": 4,
                    "planned_start_at": after(60),
                    "planned_end_at": after(84),
                }
            ),
        ),
        reason="CALLED_HOME",
    )


def _hold() -> HoldInstruction:
    return HoldInstruction(
        message_id="msg_15",
        sent_at=after(40),
        instruction_id=InstructionId("ins_06"),
        stream=1,
        seq=6,
        expires_at=after(41),
        mission_id=MISSION,
        mission_revision=1,
        reason="the operator looks at the drone",
    )


def _resume() -> ResumeInstruction:
    return ResumeInstruction(
        message_id="msg_16",
        sent_at=after(45),
        instruction_id=InstructionId("ins_07"),
        stream=1,
        seq=7,
        expires_at=after(46),
        mission_id=MISSION,
        mission_revision=1,
    )


def _cancel() -> CancelInstruction:
    return CancelInstruction(
        message_id="msg_02",
        sent_at=after(2),
        instruction_id=InstructionId("ins_02"),
        stream=1,
        seq=2,
        expires_at=after(3),
        mission_id=MISSION,
        mission_revision=2,
        reason="the customer cancelled",
    )


def _report() -> ReportInstruction:
    return ReportInstruction(
        message_id="msg_03",
        sent_at=after(30),
        instruction_id=InstructionId("ins_03"),
        stream=1,
        seq=3,
        events_confirmed_seq=4,
        expires_at=after(31),
        events_after_seq=4,
    )
