"""Escapes: what a drone does by itself instead of its plan, and will not be told out of."""

from typing import Final

from skyway.contracts.drone_health import ActiveFailsafe, Failsafe, Fault
from skyway.contracts.drone_report import DroneState
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.notify import raise_alarm
from skyway_composition.missions.mission.record import CALLED_HOME, MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: While one of these acts a drone refuses new steps, unless they override it.
_ESCAPES: Final = (Failsafe.DIVERT, Failsafe.LAND_NOW)


def steering_failsafe(record: MissionRecord, state: DroneState | None) -> ActiveFailsafe | None:
    """The failsafe that leads a mission's drone elsewhere; None while it does as it was told."""
    if record.stuck is not None or state is None or state.failsafe is None:
        return None
    is_of_this = state.mission_id == record.mission_id
    return state.failsafe if is_of_this and state.failsafe.failsafe in _ESCAPES else None


def waits_for_pad(record: MissionRecord, link: DroneLink) -> bool:
    """Whether a mission's drone stands beside a pad that something else occupies.

    What it said before its last event says nothing of that: it may have charged meanwhile.
    """
    state = link.state
    if state is None or state.mission_id != record.mission_id:
        return False
    if state.last_event_seq < link.last_event_seq:
        return False
    return state.activity == "RECHARGING" and Fault.PAD_OCCUPIED in state.faults


async def handle_failsafe_refusal(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """The record of a mission whose drone's failsafe went before its new plan.

    The plan is made once that is over; an operator whose wish it was is told. What the drone did
    not let override its failsafe does not try that again.
    """
    trouble = record.trouble
    if trouble is None:
        return record
    if trouble.code == CALLED_HOME or trouble.land_at is not None:
        escape = steering_failsafe(record, work.links[record.drone_id].state)
        acting = "a failsafe" if escape is None else f"{escape.failsafe} for {escape.fault}"
        hint = "nothing overrides this" if trouble.overrides_failsafe else "unless overridden"
        await raise_alarm(
            work,
            record,
            level="WARNING",
            code="FAILSAFE_ACTIVE",
            detail=(
                f"the drone did not take {trouble.code} ({trouble.detail}): {acting} is under way; "
                f"it is told again when that is over, {hint}"
            ),
            data={} if escape is None else escape.model_dump(mode="json"),
        )
    return record.with_trouble(trouble.model_copy(update={"overrides_failsafe": False}))
