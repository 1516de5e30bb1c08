"""What drones really flew, added up per mission from their events."""

from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent


@dataclass(slots=True)
class FlownMission:
    """Seconds and joules by what was done, up to the last hand-over so far."""

    flight_s: float = 0.0
    waiting_s: float = 0.0
    recharging_s: float = 0.0
    energy_j: float = 0.0
    delivered_at: datetime | None = None


class Flown:
    """Adds up step ends; repeated events (the same `seq` of a drone) count once."""

    def __init__(self) -> None:
        self._steps: dict[str, dict[int, DroneEvent]] = {}

    def add(self, event: DroneEvent) -> None:
        """Take in one drone event."""
        if event.event == "STEP_ENDED" and event.mission_id and event.step_id:
            self._steps.setdefault(event.mission_id, {})[event.step_id] = event

    def of(self, mission_id: str) -> FlownMission:
        """The sums of a mission up to its last hand-over; the way home is not in them."""
        steps = [step for _, step in sorted(self._steps.get(mission_id, {}).items())]
        deliveries = [n for n, step in enumerate(steps) if step.step_kind == "DELIVER"]
        flown = FlownMission()
        if not deliveries:
            return flown
        for step in steps[: deliveries[-1] + 1]:
            duration_s = (step.ended_at - (step.started_at or step.ended_at)).total_seconds()
            if step.step_kind == "FLY":
                flown.flight_s += duration_s
                flown.energy_j += step.energy_j
            elif step.step_kind == "RECHARGE":
                flown.recharging_s += duration_s
            elif step.step_kind == "WAIT":
                flown.waiting_s += duration_s
        flown.delivered_at = steps[deliveries[-1]].ended_at
        return flown
