"""A drone that lands below the reserve has raised an alarm before."""

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from tests.drone_agent.simulation.rehearsal.places import MODEL

#: The alarms about a low battery.
BATTERY_FAULTS = ("BATTERY_LOW", "BATTERY_SHORT", "BATTERY_EMPTY")

#: Charge by which the drone's prediction may be wrong.
_UNSEEN_SOC = 0.015


def unsaid(events: Iterable[DroneEvent], absences: Sequence[datetime]) -> Iterator[DroneEvent]:
    """Flights that ended below the reserve without an alarm.

    Flights in which the agent was absent for a time (`absences`) do not count.
    """
    has_said, took_off_at = False, None
    for event in events:
        if event.event == "ALARM":
            has_said = has_said or event.code in BATTERY_FAULTS
        elif event.step_kind != "FLY":
            has_said, took_off_at = False, None
        elif event.event == "STEP_ENDED":
            took_off_at = took_off_at or event.started_at or event.ended_at
            is_low = event.soc < MODEL.reserve_soc - _UNSEEN_SOC
            was_absent = any(took_off_at <= moment <= event.ended_at for moment in absences)
            if is_low and not has_said and not was_absent:
                yield event
