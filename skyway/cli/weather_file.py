"""Reads NetCDF files of weather services (CF conventions) as the JSON of a forecast."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from skyway.errors import InvalidInput, SkywayError
from skyway.geo import Position

if TYPE_CHECKING:
    from netCDF4 import Dataset, Variable

#: How the names of NetCDF files end.
NETCDF_SUFFIXES: Final = (".nc", ".nc4", ".cdf", ".netcdf")

#: For each member of a forecast: its CF standard name, and other names that weather services use.
_VARIABLES: Final[Mapping[str, tuple[str, ...]]] = {
    "eastward_wind_mps": ("eastward_wind", "u10", "10u", "uas"),
    "northward_wind_mps": ("northward_wind", "v10", "10v", "vas"),
    "wind_speed_mps": ("wind_speed", "si10", "sfcwind"),
    "wind_from_deg": ("wind_from_direction", "wdir10"),
    "gust_mps": ("wind_speed_of_gust", "fg10", "i10fg", "gust"),
    "temperature_c": ("air_temperature", "t2m", "2t", "tas"),
}
_PARTS: Final = ("eastward_wind_mps", "northward_wind_mps")
_AXES: Final[Mapping[str, tuple[str, ...]]] = {
    "time": ("time", "valid_time"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon"),
}
_ISSUED: Final = ("forecast_reference_time", "reference_time")

_KELVIN: Final = ("k", "kelvin")
_ZERO_C: Final = 273.15
#: The units of a forecast, as files write them.
_SPEEDS: Final = ("m s-1", "m/s", "m s**-1", "m.s-1", "meters per second")
_DEGREES: Final = ("degree", "degrees", "degree_true", "degrees_true")
_TEMPERATURES: Final = (*_KELVIN, "c", "degc", "celsius", "degree_celsius", "degrees_celsius")

#: Decimal places of values and of axes: forecasts are not more exact.
_DIGITS, _AXIS_DIGITS = 2, 5

Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.int64]


def read_netcdf(file: str, *, stations: Sequence[Position], source: str | None) -> dict[str, Any]:
    """The forecast in a NetCDF file, on the points of its grid around these stations.

    `source` replaces the name of the source that the file has. Any: a JSON object.

    Raises
    ------
    SkywayError
        The extra `weather` is not installed, or the file cannot be read.
    InvalidInput
        A variable is missing, or has other dimensions or units than a forecast.
    """
    try:
        from netCDF4 import Dataset
    except ImportError as error:
        raise SkywayError("a NetCDF file needs an extra: pip install 'skyway[weather]'") from error
    try:
        dataset = Dataset(file)
    except OSError as error:
        raise SkywayError(f"{file} cannot be read: {error}") from error
    with dataset:
        return _forecast(dataset, stations, source)


def _forecast(
    dataset: "Dataset", stations: Sequence[Position], source: str | None
) -> dict[str, Any]:
    axes = {name: _axis(dataset, name) for name in _AXES}
    times = _moments(axes["time"])
    issued = _found(dataset, _ISSUED)
    latitude_deg, rows = _cut(
        np.atleast_1d(axes["latitude"][...]), [each.latitude_deg for each in stations]
    )
    longitude_deg, columns = _cut(
        (np.atleast_1d(axes["longitude"][...]) + 180.0) % 360.0 - 180.0,
        [each.longitude_deg for each in stations],
    )
    values = {
        member: _rounded(_by_axes(member, variable, axes)[:, rows][:, :, columns])
        for member, variable in _wind_and_more(dataset)
    }
    return {
        "source": (source or _source(dataset))[:100],
        "issued_at": times[0] if issued is None else _moments(issued)[0],
        "grid": {
            "time": times,
            "latitude": latitude_deg,
            "longitude": longitude_deg,
            **values,
        },
    }


def _found(dataset: "Dataset", names: Sequence[str]) -> "Variable[Any] | None":
    """The variable with one of these standard names or names; the first name counts most."""
    for name in names:
        for key, variable in dataset.variables.items():
            if name in (str(getattr(variable, "standard_name", "")).lower(), key.lower()):
                return variable
    return None


def _axis(dataset: "Dataset", name: str) -> "Variable[Any]":
    axis = _found(dataset, _AXES[name])
    if axis is None or axis.ndim > 1:
        raise InvalidInput(
            name, "the file has no such axis with one dimension: only grids of degrees can be read"
        )
    return axis


def _wind_and_more(dataset: "Dataset") -> Iterator[tuple[str, "Variable[Any]"]]:
    """The variables of a forecast; of a file with both forms of the wind, its two components."""
    found = {member: _found(dataset, names) for member, names in _VARIABLES.items()}
    has_parts = all(found[member] is not None for member in _PARTS)
    for member, variable in found.items():
        is_other_form = member in ("wind_speed_mps", "wind_from_deg") and has_parts
        if variable is not None and not is_other_form and (has_parts or member not in _PARTS):
            yield member, variable


def _by_axes(member: str, variable: "Variable[Any]", axes: Mapping[str, "Variable[Any]"]) -> Any:
    """The values by time, latitude and longitude; a masked array, in the units of a forecast."""
    values = np.ma.asarray(variable[...]).astype(np.float64)
    order: list[int] = []
    dimensions = list(variable.dimensions)
    for axis in axes.values():
        if axis.ndim == 0 or axis.dimensions[0] not in dimensions:
            values, dimensions = values[..., np.newaxis], [*dimensions, ""]
            order.append(len(dimensions) - 1)
        else:
            order.append(dimensions.index(axis.dimensions[0]))
    others = [number for number in range(values.ndim) if number not in order]
    if any(values.shape[number] != 1 for number in others):
        names = ", ".join(dimensions[number] for number in others)
        raise InvalidInput(member, f"has more than one value of {names}: keep one")
    shape = [values.shape[number] for number in order]
    return _in_units(member, variable, values.transpose([*order, *others]).reshape(shape))


def _in_units(member: str, variable: "Variable[Any]", values: Any) -> Any:  # a masked array
    units = str(getattr(variable, "units", "")).strip().lower()
    allowed: tuple[str, ...] = _SPEEDS
    if member == "wind_from_deg":
        allowed = _DEGREES
    elif member == "temperature_c":
        allowed = _TEMPERATURES
    if units not in allowed:
        raise InvalidInput(member, f"has the units {units!r}; allowed are {', '.join(allowed)}")
    return values - _ZERO_C if units in _KELVIN else values


def _cut(axis_deg: Floats, stations_deg: Sequence[float]) -> tuple[list[float], Places]:
    """The values of an axis around the stations, rising, and their places in the file."""
    order = np.argsort(axis_deg)
    rising = np.asarray(axis_deg, np.float64)[order]
    first, last = 0, len(rising)
    if stations_deg:
        first = max(0, int(np.searchsorted(rising, min(stations_deg), side="right")) - 1)
        last = int(np.searchsorted(rising, max(stations_deg), side="left")) + 1
    kept = slice(min(first, len(rising) - 1), max(last, first + 1))
    return [round(float(each), _AXIS_DIGITS) for each in rising[kept]], order[kept]


def _rounded(values: Any) -> list[Any]:  # a masked array
    """The values in lists; None where the file has a hole, so that the server names it."""
    lists: list[Any] = values.round(_DIGITS).tolist()
    return lists


def _moments(variable: "Variable[Any]") -> list[str]:
    from netCDF4 import num2date

    calendar = getattr(variable, "calendar", "standard")
    found = num2date(
        np.atleast_1d(variable[...]),
        variable.units,
        calendar=calendar,
        only_use_cftime_datetimes=False,
        only_use_python_datetimes=True,
    )
    moments: list[datetime] = np.atleast_1d(np.asarray(found)).tolist()
    return [each.replace(tzinfo=UTC).isoformat() for each in moments]


def _source(dataset: "Dataset") -> str:
    names = ("source", "institution", "title")
    given = (str(getattr(dataset, name)) for name in names if name in dataset.ncattrs())
    return " ".join(next(given, "NetCDF").split())
