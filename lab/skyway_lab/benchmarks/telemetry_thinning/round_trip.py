"""A mission between four stations, as planning makes it: two packages, a recharge, and home."""

from datetime import datetime, timedelta
from typing import Any, Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
)
from skyway.drone.charging import recharge_time_s, soc_after_recharge
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import PackageId, StationId

#: Within 30 km of San Marcos, Texas, where the paper's network lies.
STATIONS: Final = {
    StationId("home"): Position(-97.94, 29.88),
    StationId("north"): Position(-97.87, 29.99),
    StationId("east"): Position(-97.72, 29.92),
    StationId("south"): Position(-97.83, 29.79),
}

#: Seconds to load, and to hand over.
_LOAD_S, _HAND_OVER_S = 60.0, 30.0

_MASS_KG: Final = 0.8


class RoundTrip:
    """Builds the steps one behind the other, as long as the model says they take."""

    def __init__(self, model: DroneModel, *, start_at: datetime) -> None:
        self.steps: list[FlightStep] = []
        self._model = model
        self._at = start_at
        self._here = StationId("home")
        self._packages: dict[str, float] = {}
        self._soc = 1.0

    def load(self, *names: str) -> None:
        """Take these packages on board."""
        self._packages |= dict.fromkeys(names, _MASS_KG)
        packages = tuple(
            PackageOnBoard(package_id=PackageId(name), mass_kg=_MASS_KG) for name in names
        )
        times = self._times(_LOAD_S)
        self.steps.append(PickUpStep(**times, station_id=self._here, packages=packages))

    def fly(self, to: str, *, lands: bool = True) -> None:
        """Fly straight to this station."""
        start, end = STATIONS[self._here], STATIONS[StationId(to)]
        model, load_kg = self._model, sum(self._packages.values())
        length_m = distance_m(start, end)
        energy_j = flight_energy_j(model, length_m=length_m, load_kg=load_kg)
        flight_s = flight_time_s(model, length_m=length_m, load_kg=load_kg)
        if lands:
            energy_j, flight_s = energy_j + model.stop_j, flight_s + model.stop_s
        self._soc -= energy_j / model.battery_j
        step = FlyStep(
            **self._times(flight_s),
            from_id=self._here,
            to_id=StationId(to),
            from_position=start,
            to_position=end,
            length_m=length_m,
            lands=lands,
        )
        self._here = StationId(to)
        self.steps.append(step)

    def hand_over(self, name: str) -> None:
        """Deliver this package."""
        del self._packages[name]
        times = self._times(_HAND_OVER_S)
        ids = (PackageId(name),)
        step = DeliverStep(**times, station_id=self._here, package_ids=ids, dropoff_s=_HAND_OVER_S)
        self.steps.append(step)

    def recharge(self, *, duration_s: float) -> None:
        """Charge for so long, with an hour to spare."""
        until_soc = soc_after_recharge(self._model, self._soc, duration_s)
        times = self._times(recharge_time_s(self._model, self._soc, until_soc))
        step = RechargeStep(
            **times,
            station_id=self._here,
            pad=0,
            not_before_at=times["planned_start_at"],
            until_soc=until_soc,
            not_after_at=self._at + timedelta(hours=1),
        )
        self._soc = until_soc
        self.steps.append(step)

    def _times(self, duration_s: float) -> dict[str, Any]:  # keywords of several types of step
        begins_at, self._at = self._at, self._at + timedelta(seconds=duration_s)
        return {
            "step_id": len(self.steps) + 1,
            "planned_start_at": begins_at,
            "planned_end_at": self._at,
        }


def round_trip(model: DroneModel, *, start_at: datetime) -> tuple[FlightStep, ...]:
    """Two packages, a station flown over, a recharge of half an hour, and home."""
    trip = RoundTrip(model, start_at=start_at)
    trip.load("p1", "p2")
    trip.fly("north", lands=False)
    trip.fly("east")
    trip.hand_over("p1")
    trip.recharge(duration_s=1_800.0)
    trip.fly("south")
    trip.hand_over("p2")
    trip.fly("home")
    return tuple(trip.steps)
