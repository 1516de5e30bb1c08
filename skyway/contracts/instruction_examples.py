"""One example of each instruction, all for one mission."""

from datetime import UTC, datetime, timedelta
from typing import Any, Final

from skyway.contracts.flight_step import (
    AwaitedProof,
    DeliverStep,
    FlightStep,
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
    HandOverInstruction,
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
    return (
        _mission(),
        _divert(),
        _return_home(),
        _hold(),
        _resume(),
        _hand_over(),
        _cancel(),
        _report(),
    )


def after(minutes: float) -> datetime:
    """So many minutes after the examples' mission was sent."""
    return START + timedelta(minutes=minutes)


def sent(number: int, minutes: float) -> dict[str, Any]:
    """The members of the message with this number, sent so many minutes after the mission."""
    return {"message_id": f"msg_{number:02}", "sent_at": after(minutes)}


def _step(number: int, begin_min: float, end_min: float) -> dict[str, Any]:
    """The members of every step."""
    span = {"planned_start_at": after(begin_min), "planned_end_at": after(end_min)}
    return {"step_id": number, **span}


def _numbered(seq: int, minutes: float, *, revision: int = 1) -> dict[str, Any]:
    """The members of the instruction with this number, except its message's id."""
    return {
        "instruction_id": InstructionId(f"ins_{seq:02}"),
        "stream": 1,
        "seq": seq,
        "expires_at": after(minutes + 1),
        "mission_id": MISSION,
        "mission_revision": revision,
    }


_OUT: Final[dict[str, Any]] = {
    "from_id": SAN_MARCOS,
    "to_id": MCQUEENEY,
    "from_position": AT_SAN_MARCOS,
    "to_position": AT_MCQUEENEY,
    "length_m": 33_600.0,
    "lands": True,
}
_BACK: Final[dict[str, Any]] = {
    **_OUT,
    "from_id": MCQUEENEY,
    "to_id": SAN_MARCOS,
    "from_position": AT_MCQUEENEY,
    "to_position": AT_SAN_MARCOS,
}
_P1: Final = PackageId("p1")
_P2: Final = PackageId("p2")


def _steps() -> tuple[FlightStep, ...]:
    return (
        PickUpStep(
            **_step(1, 5, 5),
            station_id=SAN_MARCOS,
            packages=(
                PackageOnBoard(package_id=_P1, mass_kg=0.8),
                PackageOnBoard(package_id=_P2, mass_kg=1.2),
            ),
        ),
        FlyStep(**_step(2, 5, 29), **_OUT),
        WaitStep(**_step(3, 29, 35), station_id=MCQUEENEY, until_at=after(35)),
        RechargeStep(
            **_step(4, 35, 75),
            station_id=MCQUEENEY,
            pad=0,
            not_before_at=after(35),
            until_soc=0.8,
            not_after_at=after(80),
        ),
        DeliverStep(
            **_step(5, 75, 76),
            station_id=MCQUEENEY,
            package_ids=(_P1,),
            dropoff_s=30.0,
            recipient_wait_s=300.0,
            verification=(AwaitedProof(package_id=_P1, method="PIN"),),
        ),
        FlyStep(**_step(6, 76, 100), **_BACK),
        ReturnStep(**_step(7, 100, 100), station_id=SAN_MARCOS, package_ids=(_P2,)),
    )


def _mission() -> MissionInstruction:
    return MissionInstruction(
        **sent(1, 0),
        **_numbered(1, 0),
        traceparent=TRACEPARENT,
        delivery_id=DELIVERY,
        first_step=1,
        steps=_steps(),
    )


def _divert() -> DivertInstruction:
    """McQueeney has closed: the drone on its way there flies over it."""
    return DivertInstruction(
        **sent(13, 17),
        **_numbered(4, 17, revision=2),
        traceparent=TRACEPARENT,
        delivery_id=DELIVERY,
        last_valid_step=2,
        steps=(
            FlyStep(**_step(3, 28.5, 52.5), **_BACK),
            ReturnStep(**_step(4, 52.5, 52.5), station_id=SAN_MARCOS, package_ids=(_P1, _P2)),
        ),
        reason="STATION_CLOSED: mcqueeney",
    )


def _return_home() -> ReturnHomeInstruction:
    """The drone is called home while it charges: the RECHARGE under way ends immediately."""
    return ReturnHomeInstruction(
        **sent(14, 60),
        **_numbered(5, 60, revision=2),
        delivery_id=DELIVERY,
        last_valid_step=3,
        steps=(FlyStep(**_step(4, 60, 84), **_BACK),),
        reason="CALLED_HOME",
    )


def _hold() -> HoldInstruction:
    return HoldInstruction(
        **sent(15, 40), **_numbered(6, 40), reason="the operator looks at the drone"
    )


def _resume() -> ResumeInstruction:
    return ResumeInstruction(**sent(16, 45), **_numbered(7, 45))


def _hand_over() -> HandOverInstruction:
    """The recipient has typed the PIN of p1."""
    numbered = _numbered(8, 75)
    return HandOverInstruction(**sent(17, 75), **numbered, step_id=5, package_ids=(_P1,))


def _cancel() -> CancelInstruction:
    return CancelInstruction(
        **sent(2, 2), **_numbered(2, 2, revision=2), reason="the customer cancelled"
    )


def _report() -> ReportInstruction:
    numbered = _numbered(3, 30)
    del numbered["mission_id"], numbered["mission_revision"]
    return ReportInstruction(**sent(3, 30), **numbered, events_confirmed_seq=4, events_after_seq=4)
