"""The analysis on board: makes an assessment of the drone from each reading of its sensors."""

import math
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.analysis.battery_charge import BatteryEstimate, first_charge
from skyway_drone_agent.analysis.battery_health import BatteryHealth, ChargeRate
from skyway_drone_agent.analysis.flight_estimates import (
    AHEAD_SMOOTHED_OVER_S,
    GUSTS_SMOOTHED_OVER_S,
    EnergyUseMonitor,
    Velocity,
    WindEstimate,
)
from skyway_drone_agent.analysis.landings import (
    NO_LANDINGS,
    Landing,
    LandingSource,
    RememberedLandings,
)
from skyway_drone_agent.analysis.leg import Leg, LegCache, leg_of, off_course_m
from skyway_drone_agent.analysis.reach import EnergyToLand, LandingInReach, NextLanding, Reach
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import Logbook, doing_now, run_under_way
from skyway_drone_agent.vehicle import BatteryPack, LoadedFlights, Reading, StepRun, Vehicle

#: The pack of all models.
_PACK: Final = BatteryPack()

_CALM_MPS: Final = (0.0, 0.0)

#: Looks within this time share a reading: seconds of fleet time, or of wall time if longer.
_MOMENT_FLEET_S, _MOMENT_WALL_S = 0.2, 0.05

#: The parts of a logbook that a reading and its analysis use.
_Doing = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class Assessment:
    """The state of the drone at a moment of fleet time; the terms are those of `DroneHealth`.

    `landing` is the end of the released flights, None on the ground. `off_course_m` is the distance
    from the leg, 0 on the ground. `reach` answers questions about other flights: what few looks
    need is computed when it is asked for.
    """

    at: datetime
    position: Position
    soc: float
    soc_error: float
    power_w: float
    voltage_v: float
    current_a: float
    temperature_c: float
    cell_spread_v: float
    state_of_health: float
    still_air_factor: float | None
    charge_rate_factor: float | None
    wind_mps: Velocity | None
    velocity_mps: Velocity
    landing: NextLanding | None
    landings: tuple[Landing, ...]
    legs_ahead: tuple[Leg, ...]
    off_course_m: float
    has_gps: bool
    has_battery: bool
    motors_work: bool
    pad_is_free: bool
    load_kg: float
    reach: Reach

    @property
    def speed_mps(self) -> float:
        """Over ground."""
        return math.hypot(*self.velocity_mps)

    @property
    def consumption_factor(self) -> float:
        """The energy of the flights ahead by the model's energy."""
        return self.reach.factor_over(self.legs_ahead)

    @property
    def range_m(self) -> float:
        """The range above the reserve."""
        return self.reach.range_m(self.load_kg)

    @property
    def landings_in_reach(self) -> tuple[LandingInReach, ...]:
        """The landings that the drone can reach from here, nearest first."""
        return self.reach.landings_in_reach(
            self.landings, position=self.position, load_kg=self.load_kg
        )

    @property
    def safe_landings(self) -> tuple[LandingInReach, ...]:
        """The landings that stay in reach if there is less charge than estimated."""
        return tuple(landing for landing in self.landings_in_reach if landing.is_safe)


class Analysis:
    """One drone's analysis; it learns from every reading and keeps little memory."""

    __slots__ = (
        "_charge",
        "_charge_rate",
        "_energy",
        "_gusts",
        "_health",
        "_landings",
        "_legs",
        "_model",
        "_needs",
        "_pack",
        "_wind",
    )

    def __init__(
        self,
        model: DroneModel,
        pack: BatteryPack = _PACK,
        *,
        state_of_health: float = 1.0,
        book: LandingSource = NO_LANDINGS,
    ) -> None:
        self._model = model
        self._pack = pack
        self._charge: BatteryEstimate | None = None
        self._health = BatteryHealth(pack, rated_j=model.battery_j, state_of_health=state_of_health)
        self._charge_rate = ChargeRate(model)
        self._energy = EnergyUseMonitor(power_w=model.power_empty_w)
        self._gusts = WindEstimate(smoothed_over_s=GUSTS_SMOOTHED_OVER_S)
        self._wind = WindEstimate(smoothed_over_s=AHEAD_SMOOTHED_OVER_S)
        self._landings = RememberedLandings(book)
        self._legs = LegCache(model)
        self._needs = EnergyToLand()

    def assess(self, reading: Reading, logbook: Logbook) -> Assessment:
        """The assessment after this reading, for a drone that does what its logbook says."""
        run = run_under_way(logbook)
        step = run.step if run is not None and isinstance(run.step, FlyStep) else None
        leg = self._legs.leg(step, load_kg=logbook.load_kg) if step else None
        charge = self._learn(reading, run, leg, soc=logbook.soc)
        self._charge_rate.update(reading, run, soc=charge.soc)
        gust_mps = self._gusts.update(reading, is_flying=leg is not None)
        wind_mps = self._wind.update(reading, is_flying=leg is not None)
        if logbook.mission is not None:
            self._energy.begin(logbook.mission.mission_id, reading.at)
        self._energy.update(reading, leg, wind_mps=gust_mps)
        reach = Reach(
            model=self._model,
            soc=charge.soc,
            soc_error=charge.error,
            state_of_health=self._health.state_of_health,
            still_air_factor=self._energy.factor(reading.at),
            wind_mps=wind_mps or _CALM_MPS,
        )
        return self._assess(reading, logbook, leg, reach=reach, wind_mps=wind_mps)

    def _learn(
        self, reading: Reading, run: StepRun | None, leg: Leg | None, *, soc: float
    ) -> BatteryEstimate:
        """The battery estimate after this reading."""
        charge, health = self._charge, self._health
        reading = _as_pack(reading, self._pack)
        capacity_j = self._model.battery_j * health.state_of_health
        if charge is None:
            soc, error = first_charge(
                reading, run, leg, model=self._model, soc=soc, capacity_j=capacity_j
            )
            charge = self._charge = BatteryEstimate(self._pack, soc=soc, error=error)
        charge.update(
            reading,
            capacity_j=capacity_j,
            capacity_error=health.error / health.state_of_health,
        )
        if reading.has_battery:
            health.update(reading, resistance_ohm=charge.resistance_ohm)
        return charge

    def _assess(
        self,
        reading: Reading,
        logbook: Logbook,
        leg: Leg | None,
        *,
        reach: Reach,
        wind_mps: Velocity | None,
    ) -> Assessment:
        return Assessment(
            at=reading.at,
            position=reading.position,
            soc=reach.soc,
            soc_error=reach.soc_error,
            power_w=reading.power_w,
            voltage_v=reading.voltage_v,
            current_a=reading.current_a,
            temperature_c=reading.temperature_c,
            cell_spread_v=self._health.cell_spread_v,
            state_of_health=reach.state_of_health,
            still_air_factor=self._energy.measured,
            charge_rate_factor=self._charge_rate.factor,
            wind_mps=wind_mps,
            velocity_mps=reading.ground_mps,
            landing=self._next_landing(reading, logbook, leg, reach=reach),
            landings=self._landings.after(logbook, leg.step if leg else None),
            legs_ahead=self._legs.ahead(logbook),
            off_course_m=off_course_m(leg, reading.position) if leg else 0.0,
            has_gps=reading.has_gps,
            has_battery=reading.has_battery,
            motors_work=reading.motors_work,
            pad_is_free=reading.pad_is_free,
            load_kg=logbook.load_kg if reading.load_kg is None else reading.load_kg,
            reach=reach,
        )

    def _next_landing(
        self, reading: Reading, logbook: Logbook, leg: Leg | None, *, reach: Reach
    ) -> NextLanding | None:
        flights = self._legs.released(logbook, leg)
        if not flights:
            return None
        need_j = self._needs.need_j(reading, leg, flights, reach=reach)
        return NextLanding(flights[-1].step.to_id, need_j, reach.soc_after(need_j))


def _as_pack(reading: Reading, pack: BatteryPack) -> Reading:
    """The same power at the voltage of a battery with the pack's number of cells."""
    if reading.cells == pack.cells:
        return reading
    factor = pack.cells / reading.cells
    return replace(
        reading, voltage_v=reading.voltage_v * factor, current_a=reading.current_a / factor
    )


class Lookout:
    """Makes the assessments that guard, state and telemetry share."""

    __slots__ = ("_analysis", "_clock", "_doing", "_newest", "_recorder", "_vehicle")

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        book: LandingSource = NO_LANDINGS,
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        health = recorder.logbook.state_of_health
        self._analysis = Analysis(vehicle.model, state_of_health=health, book=book)
        self._newest: Assessment | None = None
        self._doing: _Doing = ()

    def look(self) -> Assessment:
        """Read the sensors now, unless they were read at this moment for what the drone does."""
        moment = fleet_margin(self._clock, fleet_s=_MOMENT_FLEET_S, wall_s=_MOMENT_WALL_S)
        logbook, now = self._recorder.logbook, self._clock.now()
        newest, doing = self._newest, _doing_of(logbook)
        if newest is not None and abs(now - newest.at) <= moment and self._doing == doing:
            return newest
        reading = self._vehicle.read(doing_now(logbook), now)
        self._newest, self._doing = self._analysis.assess(reading, logbook), doing
        return self._newest

    def energy_use(self, flights: LoadedFlights) -> float:
        """The energy of these flights, divided by what the model uses for them in still air.

        Each flight comes with its load in kilograms. The wind of now counts.
        Without flights this is the factor in still air.
        """
        model = self._vehicle.model
        legs = [leg_of(step, model=model, load_kg=load_kg) for step, load_kg in flights]
        return self.look().reach.factor_over(legs)


def _doing_of(logbook: Logbook) -> _Doing:
    """Without the messages from and to the cloud, which do not change the sensors."""
    standing = (logbook.station_id, logbook.position, logbook.soc, logbook.packages)
    mission = logbook.mission
    if mission is None:
        return standing
    return (
        *standing,
        mission.mission_id,
        mission.steps,
        mission.began_at,
        mission.changed_at,
        mission.escape,
        mission.flown_before,
    )
