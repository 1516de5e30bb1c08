"""Where a step begins and ends."""

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.ids import StationId


def start_of(step: FlightStep) -> StationId:
    """The station at which the drone must be for this step."""
    return step.from_id if isinstance(step, FlyStep) else step.station_id


def end_of(step: FlightStep) -> StationId:
    """The station at, or over, which the drone is after this step."""
    return step.to_id if isinstance(step, FlyStep) else step.station_id
