"""A sample as it was heard."""

from dataclasses import dataclass

from skyway.contracts.drone_report import Telemetry
from skyway.ids import DroneId


@dataclass(frozen=True, slots=True)
class HeardSample:
    """A drone's sample, and the wall ms at which it was heard."""

    drone_id: DroneId
    sample: Telemetry
    wall_ms: int
