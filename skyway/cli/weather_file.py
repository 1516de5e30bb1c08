"""Reads NetCDF files of weather services (CF conventions) as the JSON of a forecast.

Variables and axes are found by what they mean: by standard name, units, axis and height. A name
counts only for a variable without a standard name. What is ambiguous is refused.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from skyway.errors import InvalidInput, SkywayError
from skyway.geo import Position

if TYPE_CHECKING:
    from netCDF4 import Dataset, Variable

#: How the names of files end.
NETCDF_SUFFIXES: Final = (".nc", ".nc4", ".cdf", ".netcdf")
GRIB_SUFFIXES: Final = (".grib", ".grib2", ".grb", ".grb2", ".gri")

#: For each member of a forecast: its unit, its CF standard name, and names without a standard name.
_VARIABLES: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = {
    "eastward_wind_mps": ("m s-1", ("eastward_wind", "u10", "10u", "uas")),
    "northward_wind_mps": ("m s-1", ("northward_wind", "v10", "10v", "vas")),
    "wind_speed_mps": ("m s-1", ("wind_speed", "si10", "sfcwind")),
    "wind_from_deg": ("degree", ("wind_from_direction", "wdir10")),
    "gust_mps": ("m s-1", ("wind_speed_of_gust", "fg10", "i10fg", "gust")),
    "temperature_c": ("degC", ("air_temperature", "t2m", "2t", "tas")),
}
_PARTS: Final = ("eastward_wind_mps", "northward_wind_mps")
_SPEED: Final = ("wind_speed_mps", "wind_from_deg")
_AXES: Final[Mapping[str, tuple[str, ...]]] = {
    "time": ("time", "valid_time"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon"),
}
_ISSUED: Final = ("forecast_reference_time", "reference_time")
_VERTICAL: Final = ("height", "altitude", "air_pressure", "model_level_number")
_CALENDARS: Final = ("standard", "gregorian", "proleptic_gregorian")

#: Metres above the ground: the usual height of wind and of temperature in forecasts.
_USUAL_M: Final = 10.0
_TEMPERATURE_M: Final = 2.0

#: Decimal places of values and of axes: forecasts are not more exact.
_DIGITS, _AXIS_DIGITS = 2, 5

Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Layer:
    """A variable at one height; `level` is its place along the `dimension` of heights."""

    variable: "Variable[Any]"
    height: str | None = None
    height_m: float | None = None
    dimension: str | None = None
    level: int = 0

    def __str__(self) -> str:
        return f"{self.variable.name} at {self.height or 'no stated height'}"


def read_netcdf(
    file: str, *, stations: Sequence[Position], source: str | None, height_m: float | None = None
) -> dict[str, Any]:
    """The forecast in a NetCDF file, on the points of its grid around these stations.

    `source` replaces the name of the source that the file has. `height_m` names the height of the
    wind, if it is not 10 m and the file has several. Any: a JSON object.

    Raises
    ------
    SkywayError
        The extra `weather` is not installed, or the file cannot be read.
    InvalidInput
        A variable is missing or ambiguous, or has other dimensions or units than a forecast.
    """
    try:
        from netCDF4 import Dataset
    except ImportError as error:
        raise SkywayError("a NetCDF file needs an extra: pip install 'skyway[weather]'") from error
    try:
        dataset = Dataset(file)
    except OSError as error:
        raise SkywayError(f"it cannot be read as NetCDF: {error.strerror}") from error
    with dataset:
        try:
            return _forecast(dataset, stations, source, height_m)
        except InvalidInput:
            raise
        except (
            ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError
        ) as error:  # fmt: skip
            raise SkywayError(f"its variables contradict each other: {error}") from error


def _forecast(
    dataset: "Dataset", stations: Sequence[Position], source: str | None, height_m: float | None
) -> dict[str, Any]:
    axes = {name: _axis(dataset, name) for name in _AXES}
    if axes["latitude"].ndim and axes["latitude"].dimensions == axes["longitude"].dimensions:
        raise InvalidInput(
            "latitude", f"places along one dimension ({axes['latitude'].dimensions[0]}) are no grid"
        )
    latitude_deg, rows = _cut(
        _degrees("latitude", axes["latitude"], most=90.0), [each.latitude_deg for each in stations]
    )
    longitude_deg, columns = _cut(
        (_degrees("longitude", axes["longitude"], most=360.0) + 180.0) % 360.0 - 180.0,
        [each.longitude_deg for each in stations],
    )
    layers = dict(_wind_and_more(dataset, height_m))
    times = _moments(axes["time"], _begins(dataset, axes["time"], layers.values()))
    issued = _found(dataset, _ISSUED)
    values = {
        member: _rounded(_by_axes(member, layer, axes)[:, rows][:, :, columns])
        for member, layer in layers.items()
    }
    if len(issued) > 1 or (issued and issued[0].size != 1):
        raise InvalidInput("forecast_reference_time", "the file has more than one: keep one")
    return {
        "source": (source or _source(dataset))[:100],
        "issued_at": _moments(issued[0])[0] if issued else times[0],
        "grid": {
            "time": times,
            "latitude": latitude_deg,
            "longitude": longitude_deg,
            **values,
        },
    }


def _meaning(variable: "Variable[Any]") -> str:
    """The standard name without its modifiers, or the name of a variable that has none."""
    words = str(getattr(variable, "standard_name", "")).lower().split()
    return words[0] if words and words[0] != "unknown" else variable.name.lower()


def _found(dataset: "Dataset", names: Sequence[str]) -> list["Variable[Any]"]:
    """The variables that mean one of these names."""
    return [each for each in dataset.variables.values() if _meaning(each) in names]


def _axis(dataset: "Dataset", name: str) -> "Variable[Any]":
    found = _found(dataset, _AXES[name])
    # A variable with a standard name means more than one with only a name.
    found = [each for each in found if hasattr(each, "standard_name")] or found
    if len(found) > 1:
        names = ", ".join(each.name for each in found)
        raise InvalidInput(name, f"the file has several such axes: {names}; keep one")
    if not found or found[0].ndim > 1:
        raise InvalidInput(
            name, "the file has no such axis with one dimension: only grids of degrees can be read"
        )
    return found[0]


def _wind_and_more(dataset: "Dataset", height_m: float | None) -> Iterator[tuple[str, _Layer]]:
    """The layers of a forecast; of a file with both forms of the wind, its two components."""
    found = {
        member: [layer for each in _found(dataset, names) for layer in _layers(dataset, each)]
        for member, (_, names) in _VARIABLES.items()
    }
    wind = _PARTS if all(found[member] for member in _PARTS) else _SPEED
    if not all(found[member] for member in wind):
        raise InvalidInput(
            "wind", "the file has neither eastward_wind with northward_wind, "
            "nor wind_speed with wind_from_direction"
        )  # fmt: skip
    chosen = {member: _chosen(member, found[member], height_m) for member in wind}
    one, other = chosen.values()
    if (one.height, one.height_m) != (other.height, other.height_m):
        raise InvalidInput(wind[0], f"{one} and {other} are not of one height")
    yield from chosen.items()
    if found["gust_mps"]:
        yield "gust_mps", _chosen("gust_mps", found["gust_mps"], None)
    if found["temperature_c"]:
        yield "temperature_c", _chosen("temperature_c", found["temperature_c"], None)


def _chosen(member: str, layers: Sequence[_Layer], height_m: float | None) -> _Layer:
    """The layer at the named height; without `height_m` a single layer may have any height."""
    usual_m = _TEMPERATURE_M if member == "temperature_c" else _USUAL_M
    at_m = usual_m if height_m is None else height_m
    fitting = [each for each in layers if each.height_m is not None and
               abs(each.height_m - at_m) < 0.01]  # fmt: skip
    if not fitting and height_m is None:
        fitting = list(layers)
    if len(fitting) == 1:
        return fitting[0]
    names = ", ".join(str(each) for each in layers)
    raise InvalidInput(
        member, f"the file has {names}: name one height of the wind with --height-m, or keep one"
    )


def _layers(dataset: "Dataset", variable: "Variable[Any]") -> list[_Layer]:
    """The variable at each of its heights."""
    named = str(getattr(variable, "coordinates", "")).split()
    for name in (*variable.dimensions, *named):
        axis = dataset.variables.get(name)
        if axis is None or axis.ndim > 1 or not _is_vertical(axis):
            continue
        units = str(getattr(axis, "units", "")).strip()
        levels = _numbers(name, axis)
        heights_m = (
            _converted(name, axis, levels, "m") if _fits(units, "m") else [None] * len(levels)
        )
        dimension = axis.dimensions[0] if axis.ndim else None
        return [
            _Layer(variable, f"{_meaning(axis)} {level:g} {units}", height_m, dimension, place)
            for place, (level, height_m) in enumerate(zip(levels, heights_m, strict=True))
        ]
    stated = re.search(r"(\d+) ?m(?:et(?:er|re)s?)?\b", str(getattr(variable, "long_name", "")))
    stated = stated or re.fullmatch(r"[uv]?(\d+)[uv]?", variable.name)
    if stated is None:
        return [_Layer(variable)]
    return [_Layer(variable, f"height {stated[1]} m", float(stated[1]))]


def _is_vertical(axis: "Variable[Any]") -> bool:
    if _meaning(axis) in _VERTICAL or hasattr(axis, "positive"):
        return True
    return getattr(axis, "axis", "Z") == "Z" and _fits(str(getattr(axis, "units", "")), "m")


def _by_axes(member: str, layer: _Layer, axes: Mapping[str, "Variable[Any]"]) -> Any:
    """The values by time, latitude and longitude; a masked array, in the units of a forecast."""
    variable = layer.variable
    values = np.ma.masked_invalid(np.ma.asarray(variable[...]).astype(np.float64))
    dimensions = list(variable.dimensions)
    if layer.dimension in dimensions:
        values = values.take([layer.level], axis=dimensions.index(layer.dimension))
    order: list[int] = []
    for axis in axes.values():
        if axis.ndim == 0 or (axis.size == 1 and axis.dimensions[0] not in dimensions):
            values, dimensions = values[..., np.newaxis], [*dimensions, ""]
            order.append(len(dimensions) - 1)
        elif axis.dimensions[0] not in dimensions:
            raise InvalidInput(member, f"{variable.name} has no values along {axis.name}")
        else:
            order.append(dimensions.index(axis.dimensions[0]))
    others = [number for number in range(values.ndim) if number not in order]
    if any(values.shape[number] != 1 for number in others):
        names = ", ".join(dimensions[number] for number in others)
        raise InvalidInput(member, f"has more than one value of {names}: keep one")
    shape = [values.shape[number] for number in order]
    values = values.transpose([*order, *others]).reshape(shape)
    mask = np.ma.getmaskarray(values)
    in_units = _converted(member, variable, values.filled(np.nan), _VARIABLES[member][0])
    return np.ma.masked_array(in_units, mask)


def _fits(units: str, unit: str) -> bool:
    from cf_units import Unit

    try:
        # An angle has no dimension, as a share has none.
        return Unit(units).is_convertible(unit) and (unit != "degree" or units not in ("1", "%"))
    except ValueError:
        return False


def _converted(field: str, variable: "Variable[Any]", values: Floats, unit: str) -> Any:
    """The values in this unit; units that UDUNITS cannot convert are refused by name."""
    from cf_units import Unit

    units = str(getattr(variable, "units", "")).strip()
    units = {"c": "degC", "f": "degF"}.get(units.lower(), units)
    if not _fits(units, unit):
        raise InvalidInput(
            field, f"{variable.name} has the units {units!r}, which cannot be converted to {unit}"
        )
    return Unit(units).convert(np.asarray(values, np.float64), unit)


def _numbers(field: str, variable: "Variable[Any]") -> Floats:
    """The values of an axis, none of which may be missing."""
    try:
        values = np.ma.atleast_1d(np.ma.asarray(variable[...]).astype(np.float64))
    except ValueError as error:
        raise InvalidInput(field, f"{variable.name} holds no numbers") from error
    filled: Floats = values.filled(np.nan)
    if filled.size == 0 or not np.isfinite(filled).all():
        raise InvalidInput(field, f"{variable.name} has missing values")
    return filled


def _degrees(field: str, axis: "Variable[Any]", *, most: float) -> Floats:
    found: Floats = _converted(field, axis, _numbers(field, axis), "degree")
    if np.abs(found).max() > most:
        raise InvalidInput(field, f"{axis.name} has values beyond {most:g} degrees")
    return found


def _cut(axis_deg: Floats, stations_deg: Sequence[float]) -> tuple[list[float], Places]:
    """The values of an axis around the stations, rising, and their places in the file."""
    # A grid around the world may hold its first longitude twice.
    rising, order = np.unique(axis_deg.round(_AXIS_DIGITS), return_index=True)
    first, last = 0, len(rising)
    if stations_deg:
        first = max(0, int(np.searchsorted(rising, min(stations_deg), side="right")) - 1)
        last = int(np.searchsorted(rising, max(stations_deg), side="left")) + 1
    kept = slice(min(first, len(rising) - 1), max(last, first + 1))
    return [float(each) for each in rising[kept]], order[kept]


def _rounded(values: Any) -> list[Any]:  # a masked array
    """The values in lists; None where the file has a hole, so that the server names it."""
    lists: list[Any] = values.round(_DIGITS).tolist()
    return lists


def _begins(
    dataset: "Dataset", time: "Variable[Any]", layers: Iterable[_Layer]
) -> "Variable[Any] | None":
    """The bounds of the times, if the values are those of a span of time and not of a moment."""
    methods = [str(getattr(each.variable, "cell_methods", "")) for each in layers]
    are_spans = all(re.search(r"\btime: (?!point)", each) for each in methods)
    return dataset.variables.get(getattr(time, "bounds", "")) if are_spans else None


def _moments(variable: "Variable[Any]", bounds: "Variable[Any] | None" = None) -> list[str]:
    """The moments of a variable, or the moments at which its bounds begin."""
    from netCDF4 import num2date

    units = str(getattr(variable, "units", ""))
    calendar = str(getattr(variable, "calendar", "standard")).lower()
    if calendar not in _CALENDARS:
        raise InvalidInput(
            "time", f"{variable.name} has the calendar {calendar!r}, not of the world"
        )
    if " since " not in units:
        raise InvalidInput(
            "time", f"{variable.name} has the units {units!r}, not a form of 'hours since a moment'"
        )
    numbers = _numbers("time", variable if bounds is None else bounds)
    numbers = numbers if bounds is None else numbers.reshape(-1, 2).min(axis=1)
    try:
        found = num2date(
            numbers, units, calendar=calendar, only_use_cftime_datetimes=False,
            only_use_python_datetimes=True,
        )  # fmt: skip
        moments: list[datetime] = np.atleast_1d(np.asarray(found)).tolist()
    except (ValueError, OverflowError) as error:
        raise InvalidInput(
            "time", f"{variable.name} has moments that cannot be: {error}"
        ) from error
    return [each.replace(tzinfo=UTC).isoformat() for each in moments]


def _source(dataset: "Dataset") -> str:
    names = ("source", "institution", "title")
    given = (str(getattr(dataset, name)) for name in names if name in dataset.ncattrs())
    return " ".join(next(given, "NetCDF").split())
