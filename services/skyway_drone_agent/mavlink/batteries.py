"""The batteries that an autopilot reports, and those among them that the drone flies on."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from skyway_drone_agent.mavlink.fields import MavlinkMessage, known, known_cells_v

#: Wall time after which the charge of a silent battery is unknown.
SILENT_AFTER: Final = timedelta(seconds=10)

#: The key of SYS_STATUS, which does not say which battery it is about. Ids are 0 to 255.
_UNNAMED: Final = -1

#: A first cell with this voltage is part of a sum that does not fit into one field.
_SPLIT_MV: Final = 65_534


@dataclass(frozen=True, slots=True)
class BatteryReport:
    """What one message says about one battery; None stands for what the autopilot does not know.

    `cells_v` is empty if only the voltage of the whole battery is known.
    """

    wall_at: datetime
    function: int
    soc: float | None
    voltage_v: float | None
    current_a: float | None
    cells_v: tuple[float, ...] = ()
    used_j: float | None = None
    used_c: float | None = None
    temperature_c: float | None = None

    @property
    def power_w(self) -> float:
        """The power drawn from the battery; 0 if it is unknown."""
        return (self.voltage_v or 0.0) * (self.current_a or 0.0)


def battery_report(message: MavlinkMessage, wall_at: datetime) -> BatteryReport:
    """A BATTERY_STATUS."""
    cells_v = known_cells_v(message)
    is_whole = len(cells_v) == 1 or message.voltages[0] == _SPLIT_MV
    return BatteryReport(
        wall_at,
        int(message.battery_function),
        known(message, "battery_remaining"),
        sum(cells_v) if cells_v else None,
        known(message, "current_battery"),
        () if is_whole else cells_v,
        used_j=known(message, "energy_consumed"),
        used_c=known(message, "current_consumed"),
        temperature_c=known(message, "temperature"),
    )


@dataclass(frozen=True, slots=True)
class Charge:
    """What the drone flies on; `consumed_j` counts on in silence with the last known power.

    `drawn_unseen_j` is the part of it that no report confirms.
    """

    is_known: bool
    soc: float | None
    voltage_v: float | None
    power_w: float
    cells_v: tuple[float, ...]
    temperature_c: float | None
    consumed_j: float
    drawn_unseen_j: float


class _Counted:
    """A battery's newest report, and what it has given: in joules, or as a share of its charge."""

    def __init__(self, first: BatteryReport) -> None:
        self.newest = first
        self.used_j = first.used_j or 0.0
        self.used_share = 1.0 - first.soc if first.used_j is None and first.soc is not None else 0.0

    def put(self, report: BatteryReport) -> None:
        before, self.newest = self.newest, report
        if before.used_j is not None and report.used_j is not None:
            self.used_j += report.used_j - before.used_j
        elif None not in (before.used_c, report.used_c, report.voltage_v):
            drawn_c = (report.used_c or 0.0) - (before.used_c or 0.0)
            self.used_j += drawn_c * (report.voltage_v or 0.0)
        elif before.soc is not None and report.soc is not None:
            self.used_share += before.soc - report.soc


class Batteries:
    """Every battery by its id. Whichever says that it powers the flight counts for the drone.

    If no battery states its function, the battery with the least id counts.
    """

    def __init__(self, dialect: Any, battery_j: float) -> None:  # pymavlink's numbers
        self._flight = {dialect.MAV_BATTERY_FUNCTION_PROPULSION, dialect.MAV_BATTERY_FUNCTION_ALL}
        self._unknown = dialect.MAV_BATTERY_FUNCTION_UNKNOWN
        self._battery_j = battery_j
        self._by_id: dict[int, _Counted] = {}

    def put(self, message: MavlinkMessage, wall_at: datetime) -> None:
        """Store a BATTERY_STATUS."""
        self._put(int(message.id), battery_report(message, wall_at))

    def put_unnamed(self, message: MavlinkMessage, wall_at: datetime) -> None:
        """Store a SYS_STATUS, which counts only while no BATTERY_STATUS has arrived."""
        soc, voltage_v = known(message, "battery_remaining"), known(message, "voltage_battery")
        current_a = known(message, "current_battery")
        self._put(_UNNAMED, BatteryReport(wall_at, self._unknown, soc, voltage_v, current_a))

    def _put(self, key: int, report: BatteryReport) -> None:
        if key in self._by_id:
            self._by_id[key].put(report)
        else:
            self._by_id[key] = _Counted(report)

    def charge(self, wall_now: datetime) -> Charge | None:
        """The charge of the drone; None if no battery for flights was ever reported.

        Of several batteries the emptiest counts, and their energies add up.
        """
        flying = self._flying()
        if not flying:
            return None
        newest = [each.newest for each in flying]
        weakest = min(newest, key=lambda each: 2.0 if each.soc is None else each.soc)
        silence = wall_now - min(each.wall_at for each in newest)
        power_w = sum(each.power_w for each in newest)
        unseen_j = max(0.0, power_w) * silence.total_seconds() if silence > SILENT_AFTER else 0.0
        share_j = self._battery_j / len(flying)
        warm_c = [each.temperature_c for each in newest if each.temperature_c is not None]
        return Charge(
            is_known=silence <= SILENT_AFTER and (weakest.soc, weakest.voltage_v) != (None, None),
            soc=weakest.soc,
            voltage_v=weakest.voltage_v,
            power_w=power_w,
            cells_v=weakest.cells_v,
            temperature_c=max(warm_c) if warm_c else None,
            consumed_j=sum(each.used_j + each.used_share * share_j for each in flying) + unseen_j,
            drawn_unseen_j=unseen_j,
        )

    def _flying(self) -> Sequence[_Counted]:
        named = {key: one for key, one in self._by_id.items() if key != _UNNAMED} or self._by_id
        flying = [one for one in named.values() if one.newest.function in self._flight]
        unknown = [key for key, one in named.items() if one.newest.function == self._unknown]
        return flying or [named[key] for key in sorted(unknown)[:1]]
