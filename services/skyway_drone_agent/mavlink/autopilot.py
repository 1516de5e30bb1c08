"""The last values that an autopilot reported over MAVLink."""

import asyncio
import math
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Final

from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.mavlink.link import MavlinkMessage, finished_within
from skyway_drone_agent.vehicle import BatteryPack, Reading

#: Wall time after which a position counts as lost.
_FRESH: Final = timedelta(seconds=5)

#: GPS_RAW_INT: the least fix that is a position in space.
_FIX_3D: Final = 3

_NO_CELL, _NO_TEMPERATURE = 65_535, 32_767

#: A coulomb for each mAh, and a joule for each hJ, of BATTERY_STATUS.
_C_PER_MAH, _J_PER_HJ = 3.6, 100.0


class Autopilot:
    """The newest of each value; `None` stands for the numbers that mean "unknown" in MAVLink."""

    def __init__(self, model: DroneModel, dialect: Any, clock: FleetClock) -> None:
        self._model = model
        self._dialect = dialect
        self._clock = clock
        self._news = asyncio.Event()
        self._pack = BatteryPack()
        self._position_wall_at: datetime | None = None
        self._has_fix = True
        self._voltage_v: float | None = None
        self._current_a: float | None = None
        self._consumed_j: float | None = None
        self._consumed_mah = 0
        self._cells_v: tuple[float, ...] = ()
        self._temperature_c = 25.0
        self._air_speed_mps: float | None = None
        self._heading_deg = 0.0
        self._wind_mps: tuple[float, float] | None = None
        self._sensors_work = True
        self.kind: int | None = None
        self.position: Position | None = None
        self.ground_mps = (0.0, 0.0)
        self.soc: float | None = None
        self.is_armed = False
        self.state: int | None = None
        self.landed_state: int | None = None
        self.item_now: int | None = None
        self.item_reached = -1

    def handle(self, message: MavlinkMessage) -> None:
        """Store the values of a message; other kinds of messages are ignored."""
        reading = _READERS.get(message.get_type())
        if reading is not None:
            reading(self, message)
            self._news.set()

    async def until(self, claim: Callable[[], bool], *, timeout_s: float | None = None) -> bool:
        """Wait until the claim holds, for at most this wall time; returns whether it does."""
        if not claim():
            await finished_within(self._clock, timeout_s, self._hold(claim))
        return claim()

    async def _hold(self, claim: Callable[[], bool]) -> None:
        while not claim():
            self._news.clear()
            await self._news.wait()

    @property
    def has_reported(self) -> bool:
        """Whether it has reported its type, its place, and whether it stands."""
        return None not in (self.kind, self.position, self.landed_state)

    @property
    def is_ardupilot(self) -> bool:
        """Whether it stores its home as the first mission item, and arms only in other modes."""
        return bool(self.kind == self._dialect.MAV_AUTOPILOT_ARDUPILOTMEGA)

    @property
    def is_on_ground(self) -> bool:
        """Whether the drone stands. Without a landed state, a disarmed drone counts as standing."""
        if self.landed_state in (None, self._dialect.MAV_LANDED_STATE_UNDEFINED):
            return not self.is_armed
        return bool(self.landed_state == self._dialect.MAV_LANDED_STATE_ON_GROUND)

    @property
    def speed_mps(self) -> float:
        """Over ground."""
        return math.hypot(*self.ground_mps)

    @property
    def power_w(self) -> float:
        """The power drawn from the battery."""
        return (self._voltage_v or 0.0) * (self._current_a or 0.0)

    def is_near(self, place: Position, *, within_m: float) -> bool:
        """Whether the drone is at this place; False if that is unknown."""
        return self.position is not None and distance_m(self.position, place) <= within_m

    def forget_mission(self) -> None:
        """Forget the reported items: they belong to an earlier mission."""
        self.item_now, self.item_reached = None, -1

    def reading(self, at: datetime, *, last_position: Position, last_soc: float) -> Reading:
        """The newest values as one reading; missing values come from the reading before."""
        soc = self.soc if self.soc is not None else last_soc
        current_a = self._current_a or 0.0
        voltage_v = self._voltage_v
        if voltage_v is None:
            voltage_v = self._pack.open_voltage_v(soc)
        cells_v = self._cells_v or (voltage_v / self._pack.cells,)
        consumed_j = self._consumed_j
        if consumed_j is None:
            consumed_j = (1.0 - soc) * self._model.battery_j
        return Reading(
            at=at,
            position=self.position or last_position,
            ground_mps=self.ground_mps,
            air_mps=self._air_mps(),
            voltage_v=voltage_v,
            current_a=current_a,
            consumed_j=consumed_j,
            cell_low_v=min(cells_v),
            cell_high_v=max(cells_v),
            temperature_c=self._temperature_c,
            has_gps=self._has_fix and self._is_position_fresh(),
            motors_work=self._motors_work(),
        )

    def _air_mps(self) -> tuple[float, float]:
        """Air velocity: by the autopilot's wind, else along its heading, else as over ground."""
        if self._wind_mps is not None:
            east, north = self._wind_mps
            return self.ground_mps[0] - east, self.ground_mps[1] - north
        if not self._air_speed_mps:
            return self.ground_mps
        nose = math.radians(self._heading_deg)
        return self._air_speed_mps * math.sin(nose), self._air_speed_mps * math.cos(nose)

    def _is_position_fresh(self) -> bool:
        seen_at = self._position_wall_at
        return seen_at is not None and self._clock.wall_now() - seen_at <= _FRESH

    def _motors_work(self) -> bool:
        return self._sensors_work and self.state != self._dialect.MAV_STATE_EMERGENCY

    def _heartbeat(self, message: MavlinkMessage) -> None:
        self.kind, self.state = message.autopilot, message.system_status
        self.is_armed = bool(message.base_mode & self._dialect.MAV_MODE_FLAG_SAFETY_ARMED)

    def _extended_sys_state(self, message: MavlinkMessage) -> None:
        self.landed_state = message.landed_state

    def _global_position_int(self, message: MavlinkMessage) -> None:
        self.position = Position(message.lon / 1e7, message.lat / 1e7)
        self.ground_mps = (message.vy / 100, message.vx / 100)  # vx is to the north
        self._position_wall_at = self._clock.wall_now()

    def _gps_raw_int(self, message: MavlinkMessage) -> None:
        self._has_fix = message.fix_type >= _FIX_3D

    def _vfr_hud(self, message: MavlinkMessage) -> None:
        self._air_speed_mps, self._heading_deg = message.airspeed, float(message.heading)

    def _wind_cov(self, message: MavlinkMessage) -> None:
        self._wind_mps = (message.wind_y, message.wind_x)  # x is to the north

    def _battery_status(self, message: MavlinkMessage) -> None:
        cells_v = tuple(one / 1000 for one in message.voltages if one not in (0, _NO_CELL))
        if cells_v:
            self._voltage_v = sum(cells_v)
            # A single number is the voltage of the whole pack.
            self._cells_v = cells_v if len(cells_v) > 1 else ()
        if message.current_battery >= 0:
            self._current_a = message.current_battery / 100
        if message.energy_consumed >= 0:
            self._consumed_j = message.energy_consumed * _J_PER_HJ
        elif message.current_consumed >= 0 and self._voltage_v is not None:
            drawn_mah = message.current_consumed - self._consumed_mah
            self._consumed_mah = message.current_consumed
            drawn_j = drawn_mah * _C_PER_MAH * self._voltage_v
            self._consumed_j = (self._consumed_j or 0.0) + drawn_j
        if message.battery_remaining >= 0:
            self.soc = min(1.0, message.battery_remaining / 100)
        if message.temperature != _NO_TEMPERATURE:
            self._temperature_c = message.temperature / 100

    def _sys_status(self, message: MavlinkMessage) -> None:
        motors = self._dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        is_watched = message.onboard_control_sensors_enabled & motors
        self._sensors_work = not is_watched or bool(message.onboard_control_sensors_health & motors)
        if self._voltage_v is None and message.voltage_battery != _NO_CELL:
            self._voltage_v = message.voltage_battery / 1000
        if self.soc is None and message.battery_remaining >= 0:
            self.soc = min(1.0, message.battery_remaining / 100)

    def _mission_current(self, message: MavlinkMessage) -> None:
        self.item_now = message.seq

    def _mission_item_reached(self, message: MavlinkMessage) -> None:
        self.item_reached = max(self.item_reached, message.seq)


_READERS: Final[dict[str, Callable[[Autopilot, MavlinkMessage], None]]] = {
    "HEARTBEAT": Autopilot._heartbeat,
    "EXTENDED_SYS_STATE": Autopilot._extended_sys_state,
    "GLOBAL_POSITION_INT": Autopilot._global_position_int,
    "GPS_RAW_INT": Autopilot._gps_raw_int,
    "VFR_HUD": Autopilot._vfr_hud,
    "WIND_COV": Autopilot._wind_cov,
    "BATTERY_STATUS": Autopilot._battery_status,
    "SYS_STATUS": Autopilot._sys_status,
    "MISSION_CURRENT": Autopilot._mission_current,
    "MISSION_ITEM_REACHED": Autopilot._mission_item_reached,
}
