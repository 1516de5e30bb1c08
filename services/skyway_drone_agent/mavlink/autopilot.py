"""The last values that an autopilot reported over MAVLink."""

import asyncio
import math
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Final

from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.mavlink.batteries import Batteries
from skyway_drone_agent.mavlink.fields import MavlinkMessage, known
from skyway_drone_agent.mavlink.link import finished_within, is_of_aircraft
from skyway_drone_agent.vehicle import BatteryPack, Reading

#: Wall time after which a value counts as unknown, unless its message is repeated.
_FRESH: Final = timedelta(seconds=5)

#: GPS_RAW_INT: the least fix that is a position in space.
_FIX_3D: Final = 3

#: The battery's temperature if no message states it.
_MILD_C: Final = 25.0

#: Volts of a cell in use, and in the middle of its curve.
_LEAST_CELL_V, _MOST_CELL_V, _MIDDLE_CELL_V = 3.0, 4.4, 3.8

#: East and north, metres per second.
_Velocity = tuple[float, float]


class Autopilot:
    """The newest of each value; `None` stands for what the autopilot does not know, or not now."""

    def __init__(self, model: DroneModel, dialect: Any, clock: FleetClock) -> None:
        self._model = model
        self._dialect = dialect
        self._clock = clock
        self._news = asyncio.Event()
        self._pack = BatteryPack()
        self._batteries = Batteries(dialect, model.battery_j)
        #: Wall moments of the newest message of each type that had a known value.
        self._newest_at: dict[str, datetime] = {}
        self._fixes: dict[str, float] = {}
        self._ground_mps: _Velocity | None = None
        self._air_speed_mps: float | None = None
        self._heading_deg: float | None = None
        self._wind_mps: _Velocity | None = None
        self._landed_state: int | None = None
        self._sensors_work = True
        self.kind: int | None = None
        self.position: Position | None = None
        self.is_armed = False
        self.state: int | None = None
        self.item_now: int | None = None
        self.item_reached = -1

    def handle(self, message: MavlinkMessage) -> None:
        """Store the known values of a message; other kinds of messages are ignored."""
        kind = message.get_type()
        reading = _READERS.get(kind)
        if reading is not None and reading(self, message):
            self._newest_at[kind] = self._clock.wall_now()
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
    def soc(self) -> float | None:
        """The charge of the batteries that the drone flies on."""
        charge = self._batteries.charge(self._clock.wall_now())
        return charge.soc if charge is not None and charge.is_known else None

    def least_soc(self, last_soc: float) -> float:
        """The charge after a silent battery gave on; `last_soc` if no message ever stated it."""
        charge = self._batteries.charge(self._clock.wall_now())
        if charge is None or charge.soc is None:
            return last_soc
        return max(0.0, charge.soc - charge.drawn_unseen_j / self._model.battery_j)

    @property
    def ground_mps(self) -> _Velocity:
        """Over ground; zero if it is unknown."""
        return self._ground_mps or (0.0, 0.0)

    @property
    def landed_state(self) -> int | None:
        """None if the state is no longer repeated, although there are heartbeats."""
        newest_at, beat_at = (
            self._newest_at.get("EXTENDED_SYS_STATE"),
            self._newest_at.get("HEARTBEAT"),
        )
        if newest_at is None or beat_at is None or beat_at - newest_at <= _FRESH:
            return self._landed_state
        return None

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
        """The power drawn from the batteries; 0 if it is unknown."""
        charge = self._batteries.charge(self._clock.wall_now())
        return charge.power_w if charge is not None else 0.0

    def is_near(self, place: Position, *, within_m: float) -> bool:
        """Whether the drone is at this place; False if that is unknown."""
        return self.position is not None and distance_m(self.position, place) <= within_m

    def forget_mission(self) -> None:
        """Forget the reported items: they belong to an earlier mission."""
        self.item_now, self.item_reached = None, -1

    def reading(self, at: datetime, *, last_position: Position, last_soc: float) -> Reading:
        """The newest values as one reading; missing values come from the reading before."""
        charge, soc = self._batteries.charge(self._clock.wall_now()), self.least_soc(last_soc)
        voltage_v = charge.voltage_v if charge is not None else None
        cells_v = charge.cells_v if charge is not None else ()
        if voltage_v is None:
            voltage_v = self._pack.open_voltage_v(soc)
        cells = len(cells_v) or self._cells_of(voltage_v)
        temperature_c = charge.temperature_c if charge is not None else None
        return Reading(
            at=at,
            position=self.position or last_position,
            ground_mps=self.ground_mps,
            air_mps=self._air_mps(),
            voltage_v=voltage_v,
            current_a=charge.power_w / voltage_v if charge is not None else 0.0,
            consumed_j=charge.consumed_j if charge is not None else 0.0,
            cell_low_v=min(cells_v, default=voltage_v / cells),
            cell_high_v=max(cells_v, default=voltage_v / cells),
            temperature_c=_MILD_C if temperature_c is None else temperature_c,
            has_gps=self._has_fix() and self._is_fresh("GLOBAL_POSITION_INT"),
            has_battery=charge is not None and charge.is_known,
            motors_work=self._motors_work(),
            cells=cells,
        )

    def _cells_of(self, voltage_v: float) -> int:
        """The number of cells that explains the voltage of a whole battery."""
        if _LEAST_CELL_V <= voltage_v / self._pack.cells <= _MOST_CELL_V:
            return self._pack.cells
        return max(1, round(voltage_v / _MIDDLE_CELL_V))

    def _air_mps(self) -> _Velocity:
        """Air velocity: by the autopilot's wind, else along its heading, else as over ground."""
        ground_mps, wind_mps = self._ground_mps, self._wind_mps
        if ground_mps is not None and wind_mps is not None and self._is_fresh("WIND_COV"):
            return ground_mps[0] - wind_mps[0], ground_mps[1] - wind_mps[1]
        if ground_mps is None or not (self._air_speed_mps and self._is_fresh("VFR_HUD")):
            return self.ground_mps
        if self._heading_deg is None:
            return ground_mps
        nose = math.radians(self._heading_deg)
        return self._air_speed_mps * math.sin(nose), self._air_speed_mps * math.cos(nose)

    def _has_fix(self) -> bool:
        """Whether a satellite receiver has reported a position in space a short while ago."""
        return any(fix >= _FIX_3D and self._is_fresh(kind) for kind, fix in self._fixes.items())

    def _is_fresh(self, kind: str) -> bool:
        newest_at = self._newest_at.get(kind)
        return newest_at is not None and self._clock.wall_now() - newest_at <= _FRESH

    def _motors_work(self) -> bool:
        stopped = (
            self._dialect.MAV_STATE_EMERGENCY,
            self._dialect.MAV_STATE_FLIGHT_TERMINATION,
        )
        return self._sensors_work and self.state not in stopped

    # The readers return whether the message stated a value.

    def _heartbeat(self, message: MavlinkMessage) -> bool:
        if not is_of_aircraft(message, self._dialect):
            return False
        self.kind, self.state = message.autopilot, message.system_status
        self.is_armed = bool(message.base_mode & self._dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        return True

    def _extended_sys_state(self, message: MavlinkMessage) -> bool:
        self._landed_state = message.landed_state
        return known(message, "landed_state") is not None

    def _global_position_int(self, message: MavlinkMessage) -> bool:
        longitude_deg, latitude_deg = known(message, "lon"), known(message, "lat")
        # Before the first fix autopilots send 0/0, or the place where they were switched off.
        if longitude_deg is None or latitude_deg is None or not self._has_fix():
            return False
        if (longitude_deg, latitude_deg) == (0.0, 0.0):
            return False
        self.position = Position(longitude_deg, latitude_deg)
        self._ground_mps = _velocity(
            known(message, "vy"), known(message, "vx")
        )  # x is to the north
        return True

    def _gps(self, message: MavlinkMessage) -> bool:
        self._fixes[message.get_type()] = known(message, "fix_type") or 0.0
        return True

    def _vfr_hud(self, message: MavlinkMessage) -> bool:
        self._air_speed_mps = known(message, "airspeed")
        self._heading_deg = known(message, "heading")
        return True

    def _wind_cov(self, message: MavlinkMessage) -> bool:
        self._wind_mps = _velocity(known(message, "wind_y"), known(message, "wind_x"))
        return True

    def _battery_status(self, message: MavlinkMessage) -> bool:
        self._batteries.put(message, self._clock.wall_now())
        return True

    def _sys_status(self, message: MavlinkMessage) -> bool:
        motors = self._dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        is_watched = message.onboard_control_sensors_enabled & motors
        self._sensors_work = not is_watched or bool(message.onboard_control_sensors_health & motors)
        self._batteries.put_unnamed(message, self._clock.wall_now())
        return True

    def _mission_current(self, message: MavlinkMessage) -> bool:
        has_mission = known(message, "total") is not None
        self.item_now = message.seq if has_mission else None
        return True

    def _mission_item_reached(self, message: MavlinkMessage) -> bool:
        self.item_reached = max(self.item_reached, message.seq)
        return True


def _velocity(east_mps: float | None, north_mps: float | None) -> _Velocity | None:
    return None if east_mps is None or north_mps is None else (east_mps, north_mps)


_READERS: Final[dict[str, Callable[[Autopilot, MavlinkMessage], bool]]] = {
    "HEARTBEAT": Autopilot._heartbeat,
    "EXTENDED_SYS_STATE": Autopilot._extended_sys_state,
    "GLOBAL_POSITION_INT": Autopilot._global_position_int,
    "GPS_RAW_INT": Autopilot._gps,
    "GPS2_RAW": Autopilot._gps,
    "VFR_HUD": Autopilot._vfr_hud,
    "WIND_COV": Autopilot._wind_cov,
    "BATTERY_STATUS": Autopilot._battery_status,
    "SYS_STATUS": Autopilot._sys_status,
    "MISSION_CURRENT": Autopilot._mission_current,
    "MISSION_ITEM_REACHED": Autopilot._mission_item_reached,
}
