"""A step of a mission and how it ended."""

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
