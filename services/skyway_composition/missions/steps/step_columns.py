"""What is kept of a step beside its JSON: for statistics, and for closures to find who is hit."""

from typing import Any

from skyway.contracts.flight_step import FlightStep
from skyway.units import moment_to_ms


def step_columns(step: FlightStep) -> dict[str, Any]:  # column values of any type
    """The columns of `mission_steps` that say what a step does, where and when."""
    return {
        "kind": step.kind,
        "station_id": None if step.kind == "FLY" else step.station_id,
        "pad": step.pad if step.kind == "RECHARGE" else None,
        "planned_start_ms": moment_to_ms(step.planned_start_at),
        "planned_end_ms": moment_to_ms(step.planned_end_at),
        "from_station_id": step.from_id if step.kind == "FLY" else None,
        "to_station_id": step.to_id if step.kind == "FLY" else None,
        "lands": step.lands if step.kind == "FLY" else None,
    }
