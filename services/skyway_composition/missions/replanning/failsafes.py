"""Failsafes: what a drone does on its own instead of its plan; it then refuses new steps."""

from typing import Final

from skyway.contracts.drone_health import ActiveFailsafe, Failsafe, Fault
from skyway.contracts.drone_report import DroneState
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.notify import raise_alarm
from skyway_composition.missions.mission.record import CALLED_HOME, MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: While one of these is active a drone refuses new steps, unless they override it.
_STEERING: Final = (Failsafe.DIVERT, Failsafe.LAND_NOW)


def steering_failsafe(record: MissionRecord, state: DroneState | None) -> ActiveFailsafe | None:
    """The failsafe that leads a mission's drone elsewhere; None while it follows its plan."""
    if record.stuck is not None or state is None or state.failsafe is None:
        return None
    is_of_this = state.mission_id == record.mission_id
    return state.failsafe if is_of_this and state.failsafe.failsafe in _STEERING else None


def waits_for_pad(record: MissionRecord, link: DroneLink) -> bool:
    """Whether a mission's drone waits beside an occupied pad.

    A state from before its last event does not count: the drone may have charged meanwhile.
    """
    state = link.state
    if state is None or state.mission_id != record.mission_id:
        return False
    if state.last_event_seq < link.last_event_seq:
        return False
    return state.activity == "RECHARGING" and Fault.PAD_OCCUPIED in state.faults


async def handle_failsafe_refusal(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """A drone has refused a new plan because of its failsafe; returns the changed record.

    The plan is made again once the failsafe is over. If an operator had asked for the plan,
    operators get an alarm. A plan that could not override the failsafe does not try so again.
    """
    trouble = record.trouble
    if trouble is None:
        return record
    if trouble.code == CALLED_HOME or trouble.land_at is not None:
        active = steering_failsafe(record, work.links[record.drone_id].state)
        acting = "a failsafe" if active is None else f"{active.failsafe} for {active.fault}"
        hint = "nothing overrides this" if trouble.overrides_failsafe else "unless overridden"
        await raise_alarm(
            work,
            record,
            level="WARNING",
            code="FAILSAFE_ACTIVE",
            detail=(
                f"the drone refused {trouble.code} ({trouble.detail}): {acting} is under way; "
                f"it is sent again when that is over, {hint}"
            ),
            data={} if active is None else active.model_dump(mode="json"),
        )
    return record.with_trouble(trouble.model_copy(update={"overrides_failsafe": False}))
