"""Plans of the fake cloud: simple, flyable, and recharging where the charge does not last."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.ids import PackageId, StationId
from tests.drone_agent.simulation.rehearsal.places import HOME, MODEL, POSITIONS, length_m, route

#: Charge that plans keep above the reserve.
_SPARE_SOC = 0.02

#: How long a pad stays reserved behind the planned end of a recharge.
_PAD_SPARE_S = 900.0

_LOADING_S, _DROPOFF_S, _RETURN_S = 60.0, 30.0, 45.0


class NoWay(Exception):
    """Even a full battery does not suffice."""


@dataclass(frozen=True)
class Standing:
    """Where a drone is, or will be, with its charge and load."""

    station_id: str
    soc: float
    load: dict[str, float] = field(default_factory=dict)  # kg by package

    @property
    def load_kg(self) -> float:
        return sum(self.load.values())


@dataclass(frozen=True)
class Parcel:
    """A package and where it goes."""

    package_id: str
    mass_kg: float
    station_id: str


def leg_j(start: str, end: str, *, load_kg: float, lands: bool, factor: float = 1.0) -> float:
    """The energy of one flight."""
    way_j = flight_energy_j(MODEL, length_m=length_m(start, end), load_kg=load_kg)
    return way_j * factor + (MODEL.stop_j if lands else 0.0)


def standing_after(standing: Standing, steps: Iterable[FlightStep], *, factor: float) -> Standing:
    """Where these steps lead."""
    for step in steps:
        load = dict(standing.load)
        match step:
            case PickUpStep():
                load |= {one.package_id: one.mass_kg for one in step.packages}
                standing = replace(standing, load=load)
            case DeliverStep() | ReturnStep():
                for package_id in step.package_ids:
                    load.pop(package_id, None)
                standing = replace(standing, load=load)
            case RechargeStep():
                standing = replace(standing, soc=max(standing.soc, step.until_soc))
            case FlyStep():
                used_j = leg_j(
                    step.from_id,
                    step.to_id,
                    load_kg=standing.load_kg,
                    lands=step.lands,
                    factor=factor,
                )
                soc = standing.soc - used_j / MODEL.battery_j
                standing = replace(standing, station_id=step.to_id, soc=soc)
            case WaitStep():
                pass
    return standing


class Plan:
    """Steps one behind the other, from a standing on."""

    def __init__(self, standing: Standing, *, at: datetime, first_step: int, factor: float) -> None:
        self.steps: list[FlightStep] = []
        self._standing = standing
        self._at = at
        self._next_id = first_step
        self._factor = factor

    def pick_up(self, parcels: Sequence[Parcel], *, awaits_confirmation: bool) -> None:
        packages = tuple(
            PackageOnBoard(package_id=PackageId(one.package_id), mass_kg=one.mass_kg)
            for one in parcels
        )
        self._add(
            PickUpStep(
                **self._times(_LOADING_S),
                station_id=StationId(self._standing.station_id),
                packages=packages,
                awaits_confirmation=awaits_confirmation,
            )
        )

    def wait(self, duration_s: float) -> None:
        times = self._times(duration_s)
        place = StationId(self._standing.station_id)
        self._add(WaitStep(**times, station_id=place, until_at=self._at))

    def deliver(self, parcel: Parcel) -> None:
        self.fly_to(parcel.station_id)
        self._add(
            DeliverStep(
                **self._times(_DROPOFF_S),
                station_id=StationId(parcel.station_id),
                package_ids=(PackageId(parcel.package_id),),
                dropoff_s=_DROPOFF_S,
                recipient_wait_s=60.0,
            )
        )

    def bring_back(self, package_ids: Sequence[str]) -> None:
        self.fly_to(HOME)
        self._add(
            ReturnStep(
                **self._times(_RETURN_S),
                station_id=StationId(HOME),
                package_ids=tuple(PackageId(one) for one in package_ids),
            )
        )

    def fly_to(self, station_id: str) -> None:
        """Fly over the stations between if the charge lasts, else from one pad to the next."""
        while self._standing.station_id != station_id:
            way = route(self._standing.station_id, station_id)
            if not (self._lasts(way) or self._recharge_for(way)):
                way = way[:1]
                if not (self._lasts(way) or self._recharge_for(way)):
                    raise NoWay
            for place in way:
                self._fly(place, lands=place == way[-1])

    def _lasts(self, way: Sequence[str]) -> bool:
        return self._standing.soc >= self._need_soc(way)

    def _need_soc(self, way: Sequence[str]) -> float:
        start, need_j = self._standing.station_id, 0.0
        for place in way:
            need_j += leg_j(
                start,
                place,
                load_kg=self._standing.load_kg,
                lands=place == way[-1],
                factor=self._factor,
            )
            start = place
        return MODEL.reserve_soc + _SPARE_SOC + need_j / MODEL.battery_j

    def _recharge_for(self, way: Sequence[str]) -> bool:
        until_soc = self._need_soc(way)
        if until_soc > 1.0:
            return False
        charge_s = recharge_time_s(MODEL, max(0.0, self._standing.soc), until_soc)
        begin_at = self._at
        self._add(
            RechargeStep(
                **self._times(charge_s),
                station_id=StationId(self._standing.station_id),
                pad=0,
                not_before_at=begin_at,
                until_soc=until_soc,
                not_after_at=self._at + timedelta(seconds=_PAD_SPARE_S),
            )
        )
        return True

    def _fly(self, place: str, *, lands: bool) -> None:
        start = self._standing.station_id
        flight_s = flight_time_s(
            MODEL, length_m=length_m(start, place), load_kg=self._standing.load_kg
        )
        self._add(
            FlyStep(
                **self._times(flight_s + (MODEL.stop_s if lands else 0.0)),
                from_id=StationId(start),
                to_id=StationId(place),
                from_position=POSITIONS[start],
                to_position=POSITIONS[place],
                length_m=length_m(start, place),
                lands=lands,
            )
        )

    def _times(self, duration_s: float) -> dict[str, object]:
        begin_at, self._at = self._at, self._at + timedelta(seconds=duration_s)
        step_id, self._next_id = self._next_id, self._next_id + 1
        return {"step_id": step_id, "planned_start_at": begin_at, "planned_end_at": self._at}

    def _add(self, step: FlightStep) -> None:
        self.steps.append(step)
        self._standing = standing_after(self._standing, (step,), factor=self._factor)
