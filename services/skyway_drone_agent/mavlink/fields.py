"""Every field of a MAVLink message that is read: its unit, and the values that mean "unknown".

`docs/mavlink.md` shows this table, and a test compares it with the definitions of MAVLink.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

#: A MAVLink message; Any, for pymavlink makes their classes at run time.
MavlinkMessage = Any

#: The number of each MAVLink unit that makes one of our unit: mAh become coulombs, hJ joules.
_PER_UNIT: Final[Mapping[str, float]] = {
    "": 1.0,
    "degE7": 1e7,
    "deg": 1.0,
    "cm/s": 100.0,
    "m/s": 1.0,
    "cdegC": 100.0,
    "mV": 1000.0,
    "cA": 100.0,
    "mAh": 1 / 3.6,
    "hJ": 0.01,
    "%": 100.0,
}


@dataclass(frozen=True, slots=True)
class Field:
    """The unit of a field in MAVLink, and the known values: `least` to `most` except `unknown`."""

    unit: str = ""
    least: float = 0
    most: float = math.inf
    unknown: int | None = None


#: A state, a sequence number, an id.
_NUMBER: Final = Field()
#: The addressee of an answer; 0 is everybody.
_ADDRESS: Final = {"target_system": _NUMBER, "target_component": _NUMBER}
_REQUEST: Final = {"seq": _NUMBER, "mission_type": _NUMBER, **_ADDRESS}
#: 3 is a position in space; 8 is the last kind of fix.
_GPS: Final = {"fix_type": Field(most=8)}
_CENT_SPEED: Final = Field("cm/s", -32_767, 32_766)
_WIND: Final = Field("m/s", -math.inf)
_CELL: Final = Field("mV", 1, 65_534)

FIELDS: Final[Mapping[str, Mapping[str, Field]]] = {
    "HEARTBEAT": dict.fromkeys(("type", "autopilot", "base_mode", "system_status"), _NUMBER),
    "EXTENDED_SYS_STATE": {"landed_state": Field(least=1)},
    "GLOBAL_POSITION_INT": {
        "lat": Field("degE7", -900_000_000, 900_000_000),
        "lon": Field("degE7", -1_800_000_000, 1_800_000_000),
        "vx": _CENT_SPEED,
        "vy": _CENT_SPEED,
    },
    "GPS_RAW_INT": _GPS,
    "GPS2_RAW": _GPS,
    "VFR_HUD": {"airspeed": Field("m/s"), "heading": Field("deg", most=360)},
    "WIND_COV": {"wind_x": _WIND, "wind_y": _WIND},
    "BATTERY_STATUS": {
        "id": _NUMBER,
        "battery_function": _NUMBER,
        "temperature": Field("cdegC", -27_315, 32_766),
        "voltages": _CELL,
        "voltages_ext": _CELL,
        "current_battery": Field("cA", -32_767, 32_766, unknown=-1),
        "current_consumed": Field("mAh", most=2_147_483_646),
        "energy_consumed": Field("hJ", most=2_147_483_646),
        "battery_remaining": Field("%", most=100),
    },
    "SYS_STATUS": {
        "onboard_control_sensors_enabled": _NUMBER,
        "onboard_control_sensors_health": _NUMBER,
        "voltage_battery": Field("mV", 1, 65_534),
        "current_battery": Field("cA", -32_767, 32_766, unknown=-1),
        "battery_remaining": Field("%", most=100),
    },
    "MISSION_CURRENT": {"seq": _NUMBER, "total": Field(most=65_534)},
    "MISSION_ITEM_REACHED": {"seq": _NUMBER},
    "COMMAND_ACK": {"command": _NUMBER, "result": _NUMBER, **_ADDRESS},
    "MISSION_ACK": {"type": _NUMBER, "mission_type": _NUMBER, **_ADDRESS},
    "MISSION_REQUEST": _REQUEST,
    "MISSION_REQUEST_INT": _REQUEST,
}


def known(message: MavlinkMessage, name: str) -> float | None:
    """The value of a field in our unit; None if the autopilot does not know it."""
    return _known(FIELDS[message.get_type()][name], getattr(message, name))


def known_cells_v(message: MavlinkMessage) -> tuple[float, ...]:
    """The voltages of BATTERY_STATUS; the second range continues the first."""
    raw = (*message.voltages, *message.voltages_ext)
    return tuple(cell_v for one in raw if (cell_v := _known(_CELL, one)) is not None)


def _known(field: Field, raw: float) -> float | None:
    # NaN is not within any limits.
    if not field.least <= raw <= field.most or raw == field.unknown or math.isinf(raw):
        return None
    return raw / _PER_UNIT[field.unit]
