"""The fields of MAVLink that are read, against MAVLink's own definitions and the page."""

import importlib.util
import os
import re
import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from skyway_drone_agent.mavlink.autopilot import Autopilot
from skyway_drone_agent.mavlink.fields import FIELDS, known, known_cells_v

PAGE = Path(__file__).parents[3] / "docs/mavlink.md"

#: Values by the names that MAVLink's definitions use.
NAMED = {
    "UINT16_MAX": 65_535,
    "INT16_MAX": 32_767,
    "NaN": float("nan"),
    "-1": -1,
    "0": 0,
}

ALL = [(message, field) for message, fields in FIELDS.items() for field in fields]


@pytest.fixture(scope="module")
def dialect() -> Any:
    os.environ.setdefault("MAVLINK20", "1")
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v20 import common

    return common


@pytest.fixture(scope="module")
def defined(dialect: Any) -> dict[tuple[str, str], dict[str, str]]:
    """The attributes of each field in the definitions that pymavlink ships."""
    folder = Path(importlib.util.find_spec("pymavlink").origin).parent / "dialects/v20"  # type: ignore[union-attr,arg-type]
    return {
        (message.attrib["name"], field.attrib["name"]): field.attrib
        for file in ("minimal.xml", "standard.xml", "common.xml")
        for message in ElementTree.parse(folder / file).getroot().iter("message")
        for field in message.iter("field")
    }


def message_of(dialect: Any, name: str, **values: Any) -> Any:
    """A message with these fields; all other fields are 0."""
    kind = next(one for one in dialect.mavlink_map.values() if one.msgname == name)
    fields = {
        field: [0] * length if length else 0
        for field, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    }
    fields = {name: fields[name] for name in kind.fieldnames}
    fields.pop("mavlink_version", None)
    made = kind(*fields.values()) if name != "HEARTBEAT" else kind(*fields.values(), 3)
    for field, value in values.items():
        setattr(made, field, value)
    return made


@pytest.mark.parametrize(("message", "field"), ALL)
def test_a_field_has_the_unit_of_its_definition(defined: Any, message: str, field: str) -> None:
    assert FIELDS[message][field].unit == defined[message, field].get("units", "")


def test_no_unknown_value_of_a_definition_is_taken_for_a_value(dialect: Any, defined: Any) -> None:
    invalid = {place: defined[place]["invalid"] for place in ALL if "invalid" in defined[place]}
    taken = [
        (name, field)
        for (name, field), value in invalid.items()
        if field != "voltages"
        and known(message_of(dialect, name, **{field: NAMED[value]}), field) is not None
    ]

    assert len(invalid) >= 11
    assert taken == []
    assert known_cells_v(message_of(dialect, "BATTERY_STATUS", voltages=[65_535] * 10)) == ()


@pytest.mark.parametrize(
    ("message", "field", "raw"),
    [
        ("GLOBAL_POSITION_INT", "lat", 2_147_483_647),
        ("GLOBAL_POSITION_INT", "lat", 900_000_001),
        ("GLOBAL_POSITION_INT", "lon", -2_147_483_648),
        ("GLOBAL_POSITION_INT", "vx", 32_767),
        ("GLOBAL_POSITION_INT", "vy", -32_768),
        ("GPS_RAW_INT", "fix_type", 255),
        ("VFR_HUD", "airspeed", float("nan")),
        ("VFR_HUD", "airspeed", float("inf")),
        ("VFR_HUD", "heading", -1),
        ("VFR_HUD", "heading", 32_767),
        ("WIND_COV", "wind_x", float("-inf")),
        ("BATTERY_STATUS", "battery_remaining", 127),
        ("BATTERY_STATUS", "current_battery", 32_767),
        ("BATTERY_STATUS", "current_consumed", 2_147_483_647),
        ("BATTERY_STATUS", "energy_consumed", 2_147_483_647),
        ("SYS_STATUS", "voltage_battery", 0),
        ("MISSION_CURRENT", "total", 65_535),
        ("EXTENDED_SYS_STATE", "landed_state", 0),
    ],
)
def test_a_value_that_cannot_be_is_unknown(
    dialect: Any, message: str, field: str, raw: float
) -> None:
    assert known(message_of(dialect, message, **{field: raw}), field) is None


def test_the_page_shows_each_field_with_its_unit() -> None:
    rows = re.findall(
        r"^\| ([A-Z0-9_, ]+) \| ([a-z0-9_, ]+) \| (\S*?) ?\|", PAGE.read_text(), re.MULTILINE
    )

    shown = {
        (message, field): unit.replace("-", "")
        for messages, fields, unit in rows
        for message in messages.split(", ")
        for field in fields.split(", ")
    }
    assert shown == {(message, field): FIELDS[message][field].unit for message, field in ALL}


class Watched:
    """A message that remembers which of its fields were read."""

    def __init__(self, message: Any) -> None:
        self._message = message
        self.read: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if name in self._message.fieldnames:
            self.read.add(name)
        return getattr(self._message, name)


@pytest.mark.parametrize("name", [kind for kind in FIELDS if not kind.startswith("MISSION_RE")])
def test_only_fields_of_the_table_are_read(drone: Any, dialect: Any, name: str) -> None:
    clock: Any = SimpleNamespace(wall_now=lambda: datetime(2026, 3, 1, tzinfo=UTC))
    autopilot = Autopilot(drone.model, dialect, clock)
    autopilot.handle(message_of(dialect, "GPS_RAW_INT", fix_type=3))
    message = Watched(
        message_of(dialect, name, type=2) if name == "HEARTBEAT" else message_of(dialect, name)
    )

    autopilot.handle(message)

    assert message.read <= set(FIELDS[name])
