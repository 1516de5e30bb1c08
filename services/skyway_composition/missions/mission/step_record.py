"""A step of a mission, how it ended, and the totals of all ended steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

from pydantic import TypeAdapter

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep


@dataclass(frozen=True, slots=True)
class StepRecord:
    """A step as it was sent, and the event that ended it."""

    step: FlightStep
    revision: int
    status: Literal["PLANNED", "ENDED", "FAILED"]
    event: DroneEvent | None


def read_step(text: str) -> FlightStep:
    """The step in this JSON."""
    return _adapter().validate_json(text, extra="ignore")


@cache
def _adapter() -> TypeAdapter[FlightStep]:
    return TypeAdapter(FlightStep)


def flown_totals(events: Sequence[DroneEvent]) -> dict[str, float]:
    """The seconds and joules that ended steps took; `events` are in the order of their ends.

    Time between two steps counts as waiting: a drone that arrives early at its pad waits there.
    """
    totals = dict.fromkeys(("flight_s", "recharging_s", "waiting_s", "energy_j"), 0.0)
    previous_end = None
    for event in events:
        if event.started_at is None:
            continue
        if previous_end is not None:
            totals["waiting_s"] += max(0.0, (event.started_at - previous_end).total_seconds())
        previous_end = event.ended_at
        name = {"FLY": "flight_s", "RECHARGE": "recharging_s", "WAIT": "waiting_s"}.get(
            event.step_kind or ""
        )
        if name is not None:
            totals[name] += (event.ended_at - event.started_at).total_seconds()
        totals["energy_j"] += event.energy_j
    return totals
