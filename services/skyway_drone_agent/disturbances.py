"""What goes otherwise than planned for a simulated drone; by default nothing does."""

from dataclasses import dataclass

from skyway.errors import InvalidInput
from skyway.ids import StationId


@dataclass(frozen=True, slots=True)
class Disturbances:
    """Factors on what the drone model says, and stations where nobody takes packages.

    The flight factors hold for the way, not for a landing; all are above 0.
    """

    flight_time_factor: float = 1.0
    flight_energy_factor: float = 1.0
    charge_time_factor: float = 1.0
    absent_station_ids: frozenset[StationId] = frozenset()

    def __post_init__(self) -> None:
        for name in ("flight_time_factor", "flight_energy_factor", "charge_time_factor"):
            factor = getattr(self, name)
            if not 0.0 < factor < float("inf"):
                raise InvalidInput(name, f"{factor:g} is not above 0")


#: Everything goes by the drone model.
UNDISTURBED = Disturbances()
