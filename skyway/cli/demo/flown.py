"""What drones really flew, added up per mission from their events."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import DroneEvent

#: Steps in which packages change hands.
HANDLING_STEPS: Final = ("PICK_UP", "DELIVER")


@dataclass(frozen=True, slots=True)
class FlownMission:
    """Seconds and joules from a mission's start to its last delivery so far.

    The four durations add up to `delivery_time_s`.
    """

    delivery_time_s: float = 0.0
    flight_s: float = 0.0
    recharging_s: float = 0.0
    handling_s: float = 0.0
    waiting_s: float = 0.0
    energy_j: float = 0.0


class Flown:
    """Adds up the ends of steps; a repeated event (the same step of a mission) counts once."""

    def __init__(self) -> None:
        self._steps: dict[str, dict[int, DroneEvent]] = {}

    def add(self, event: DroneEvent) -> None:
        """Record one drone event."""
        if event.event == "STEP_ENDED" and event.mission_id and event.step_id:
            self._steps.setdefault(event.mission_id, {})[event.step_id] = event

    def of(self, mission_id: str, *, start_at: datetime) -> FlownMission:
        """The sums of a mission from `start_at` to its last delivery, without the way home.

        A drone waits whenever it does nothing else: in a WAIT step, and also between two steps,
        when a recharge ended early or the next step is not released yet.
        """
        steps = [step for _, step in sorted(self._steps.get(mission_id, {}).items())]
        deliveries = [n for n, step in enumerate(steps) if step.step_kind == "DELIVER"]
        if not deliveries:
            return FlownMission()
        steps = [step for step in steps[: deliveries[-1] + 1] if step.ended_at > start_at]
        delivery_time_s = (steps[-1].ended_at - start_at).total_seconds()
        flight_s = _duration_s(steps, ("FLY",), start_at)
        recharging_s = _duration_s(steps, ("RECHARGE",), start_at)
        handling_s = _duration_s(steps, HANDLING_STEPS, start_at)
        return FlownMission(
            delivery_time_s=delivery_time_s,
            flight_s=flight_s,
            recharging_s=recharging_s,
            handling_s=handling_s,
            waiting_s=delivery_time_s - flight_s - recharging_s - handling_s,
            energy_j=sum(step.energy_j for step in steps if step.step_kind == "FLY"),
        )


def _duration_s(steps: list[DroneEvent], kinds: tuple[str, ...], start_at: datetime) -> float:
    """How long the steps of these kinds lasted after `start_at`."""
    lasted = (
        step.ended_at - max(step.started_at or step.ended_at, start_at)
        for step in steps
        if step.step_kind in kinds
    )
    return sum(lasted, timedelta()).total_seconds()
