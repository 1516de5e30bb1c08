"""Typed reading of the values of a network; an error names the path of the value at fault."""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from skyway.bounds import Moment
from skyway.complaints import sentence_of
from skyway.errors import InvalidNetwork
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.columns import PARKING_WITHOUT_PADS

# All identifiers share one pattern, so the adapter of one type serves every type.
_IDENTIFIER = TypeAdapter(StationId)
_MOMENT: Final = TypeAdapter[datetime](Moment)
_LONGITUDE_LIMIT_DEG = 180.0
_LATITUDE_LIMIT_DEG = 90.0
_ALTITUDE_LIMIT_M = 100_000.0

#: The names of longitude and latitude on WGS 84, which is the only system that is read.
_WGS_84: Final = frozenset(("crs84", "epsg:4326", "wgs84", "4326"))

# The values below are `Any`: they come from json.loads and are checked here.


def mapping(value: Any, path: str) -> Mapping[str, Any]:
    """A JSON object."""
    if not isinstance(value, Mapping):
        raise InvalidNetwork(path, f"{shown(value)} is not an object")
    return value


def array(value: Any, path: str) -> list[Any] | tuple[Any, ...]:
    """A JSON array."""
    if not isinstance(value, (list, tuple)):
        raise InvalidNetwork(path, f"{shown(value)} is not an array")
    return value


def constant(value: Any, path: str, *, expected: str) -> None:
    """Exactly this string."""
    if value != expected:
        raise InvalidNetwork(path, f"{shown(value)} is not {expected!r}")


def identifier(value: Any, path: str) -> str:
    """An identifier as `skyway.ids` defines it."""
    try:
        return _IDENTIFIER.validate_python(value, strict=True)
    except ValidationError:
        raise InvalidNetwork(
            path, f"{shown(value)} is not an identifier: 1 to 64 characters of A-Za-z0-9_-"
        ) from None


def text_or_none(value: Any, path: str) -> str | None:
    """A string, or null."""
    if value is not None and not isinstance(value, str):
        raise InvalidNetwork(path, f"{shown(value)} is not a string")
    return value


def truth(value: Any, path: str) -> bool:
    """True or false; 0, 1 and strings are refused."""
    if not isinstance(value, bool):
        raise InvalidNetwork(path, f"{shown(value)} is neither true nor false")
    return value


def parking(value: Any, path: str, *, pads: int) -> bool:
    """Whether a station with this many pads is a parking station."""
    is_parking = truth(value, path)
    if is_parking and pads < 1:
        raise InvalidNetwork(path, f"{PARKING_WITHOUT_PADS}: this station has {pads}")
    return is_parking


def number(value: Any, path: str, *, low: float, high: float) -> float:
    """A finite number from low to high."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InvalidNetwork(path, f"{shown(value)} is not a number")
    if not isinstance(value, int) and not math.isfinite(value):
        raise InvalidNetwork(path, f"{value} is not a finite number")
    if value < low:
        raise InvalidNetwork(path, f"{shown(value)} is below {low:g}")
    if value > high:
        raise InvalidNetwork(path, f"{shown(value)} is above {high:g}")
    return float(value)


def whole_number(value: Any, path: str, *, low: int, high: int) -> int:
    """A whole number from low to high; 4.0 is accepted, 4.5 is not."""
    as_number = number(value, path, low=low, high=high)
    if not as_number.is_integer():
        raise InvalidNetwork(path, f"{shown(value)} is not a whole number")
    return int(as_number)


def moment_or_none(value: Any, path: str) -> datetime | None:
    """An RFC 3339 moment in UTC, or null for an open bound."""
    try:
        return None if value is None else _MOMENT.validate_python(value).astimezone(UTC)
    except ValidationError as error:
        detail = f"{sentence_of(error.errors()[0])}, not {shown(value)}"
        raise InvalidNetwork(path, detail) from None


def position(value: Any, path: str) -> Position:
    """A GeoJSON position, longitude first; its altitude, if any, must be a number, and is not used.

    Drones fly at their own height above what is below them, so stations have no altitude.
    """
    pair = array(value, path)
    if not 2 <= len(pair) <= 3:
        raise InvalidNetwork(path, f"{len(pair)} numbers instead of [longitude, latitude]")
    if len(pair) == 3:
        number(pair[2], f"{path}.2", low=-_ALTITUDE_LIMIT_M, high=_ALTITUDE_LIMIT_M)
    return Position(
        number(pair[0], f"{path}.0", low=-_LONGITUDE_LIMIT_DEG, high=_LONGITUDE_LIMIT_DEG),
        number(pair[1], f"{path}.1", low=-_LATITUDE_LIMIT_DEG, high=_LATITUDE_LIMIT_DEG),
    )


def reference_system(value: Any, path: str) -> None:
    """Refuse a coordinate reference system other than longitude and latitude on WGS 84.

    Its name stands alone, or in a `crs` member as GeoJSON had it before RFC 7946.
    """
    if isinstance(value, Mapping):
        value = mapping(value.get("properties"), f"{path}.properties").get("name")
    # As "urn:ogc:def:crs:OGC:1.3:CRS84" or "urn:ogc:def:crs:EPSG::4326".
    name = str(value).lower().removeprefix("urn:ogc:def:crs:").replace("::", ":")
    if name.removeprefix("ogc:").removeprefix("1.3:") not in _WGS_84:
        detail = f"{shown(str(value))} is not EPSG:4326: give longitude and latitude in degrees"
        raise InvalidNetwork(path, detail)


def shown(value: Any) -> str:
    """The value for a message, cut short so that a hostile document cannot make it huge."""
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value) if abs(value) < 10**40 else "a number of more than 40 digits"
    if isinstance(value, str):
        return repr(value) if len(value) <= 80 else f"{value[:80]!r}..."
    if isinstance(value, Mapping):
        return "an object"
    if isinstance(value, (list, tuple)):
        return "an array"
    return {None: "null", True: "true", False: "false"}.get(value, str(value))
