"""Forecasts as operators send them (a grid, or reports from places), and how they are shown."""

from collections.abc import Iterator, Mapping
from datetime import timedelta
from itertools import pairwise
from math import hypot
from typing import Annotated, Any, Final, Literal, Self, TypeVar

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from skyway.bounds import Moment
from skyway.contracts.message import FleetMoment
from skyway.ids import NetworkId, StationId
from skyway.json_model import JsonModel, WireModel

#: The most times, values of one variable of a grid, and reports.
MAX_TIMES: Final = 336
MAX_VALUES: Final = 100_000
MAX_REPORTS: Final = 20_000

#: The strongest wind that is believed, metres per second: the strongest gust ever measured had 113.
MAX_WIND_MPS: Final = 100.0

#: The source of the air as drones measure it: plans of a network without a forecast use it.
MEASURED: Final = "MEASURED"

_VARIABLES: Final = (
    "wind_speed_mps",
    "wind_from_deg",
    "eastward_wind_mps",
    "northward_wind_mps",
    "gust_mps",
    "temperature_c",
    "error_mps",
)

_Latitude = Annotated[float, Field(ge=-90, le=90)]
#: Files of forecasts have longitudes from -180 to 180, or from 0 to 360.
_Longitude = Annotated[float, Field(ge=-180, le=360)]
_Wind = Annotated[float, Field(ge=0, le=MAX_WIND_MPS)]
_Component = Annotated[float, Field(ge=-MAX_WIND_MPS, le=MAX_WIND_MPS)]
_Direction = Annotated[float, Field(ge=0, le=360)]
_Temperature = Annotated[float, Field(ge=-90, le=60)]
_Error = Annotated[float, Field(ge=0, le=50)]

_T = TypeVar("_T")
#: Lists are read up to their first error: a million errors would take gigabytes.
_Row = Annotated[tuple[_T, ...], Field(max_length=MAX_VALUES)]
#: One variable of a grid: by time, latitude and longitude.
_Values = _Row[_Row[_Row[_T | None]]]


def _rising(axis: tuple[Any, ...]) -> tuple[Any, ...]:  # moments or numbers
    if any(after <= before for before, after in pairwise(axis)):
        raise PydanticCustomError("order", "must rise from each value to the next")
    return axis


def _eastward(axis: tuple[float, ...]) -> tuple[float, ...]:
    """Refuse longitudes that go west; from 179 to -179 it is 2 degrees to the east."""
    steps = [after - before for before, after in pairwise(axis)]
    steps = [step if step > 0 else step + 360 for step in steps]
    if any(
        step >= 180 and after <= before
        for step, (before, after) in zip(steps, pairwise(axis), strict=True)
    ):
        raise PydanticCustomError("order", "must go east from each value to the next")
    if sum(steps) > 360:
        raise PydanticCustomError("order", "must not go around the Earth more than once")
    return axis


_Axis = Annotated[_Row[_T], Field(min_length=1), AfterValidator(_rising)]


def _fault(field: str, detail: str) -> PydanticCustomError:
    """A fault that a whole model finds in one of its fields."""
    return PydanticCustomError("forecast", "{field}: {detail}", {"field": field, "detail": detail})


class _FewMembers(JsonModel):
    """An object that is refused before a million unknown members are read."""

    @model_validator(mode="before")
    @classmethod
    def _has_few_members(cls, value: Any) -> Any:  # any JSON value
        if isinstance(value, dict) and len(value) > len(cls.model_fields):
            detail = f"{len(value)} members exceed the limit of {len(cls.model_fields)}"
            raise PydanticCustomError("too_many", "{detail}", {"detail": detail})
        return value


class WeatherGrid(_FewMembers):
    """Values for each time, latitude and longitude: lists in lists in a list, in this order.

    The wind is given by its speed and direction, or by its two components.
    """

    time: Annotated[
        tuple[Moment, ...],
        Field(
            min_length=1,
            max_length=MAX_TIMES,
            description="From when values hold, rising: until the next time, and the last ones as "
            "long as those before them, or an hour if there is one time only.",
        ),
        AfterValidator(_rising),
    ]
    latitude: Annotated[_Axis[_Latitude], Field(description="Degrees north, rising.")]
    longitude: Annotated[
        _Row[_Longitude],
        Field(
            min_length=1,
            description="Degrees east, each east of the one before: 179, 180, 181 and 179, 180, "
            "-179 are the same.",
        ),
        AfterValidator(_eastward),
    ]
    wind_speed_mps: Annotated[
        _Values[_Wind] | None,
        Field(description="Speed of the wind."),
    ] = None
    wind_from_deg: Annotated[
        _Values[_Direction] | None,
        Field(description="Where the wind comes from: 0 is north, 90 is east."),
    ] = None
    eastward_wind_mps: Annotated[
        _Values[_Component] | None,
        Field(description="How fast the air moves to the east."),
    ] = None
    northward_wind_mps: Annotated[
        _Values[_Component] | None,
        Field(description="How fast the air moves to the north."),
    ] = None
    gust_mps: Annotated[
        _Values[_Wind] | None,
        Field(description="Speed of gusts; without it the speed of the wind counts."),
    ] = None
    temperature_c: Annotated[
        _Values[_Temperature] | None,
        Field(description="Temperature of the air, degrees Celsius."),
    ] = None
    error_mps: Annotated[
        _Values[_Error] | None,
        Field(description="Standard error of the wind in each direction; plans allow for it."),
    ] = None

    @field_validator(*_VARIABLES, mode="before")
    @classmethod
    def _has_its_shape(cls, value: Any, info: ValidationInfo) -> Any:  # any JSON value
        """Check the number of values before they are read: there may be millions."""
        axes = [info.data.get(name) for name in ("time", "latitude", "longitude")]
        if value is None or None in axes:  # another error names the axis
            return value
        times, latitudes, longitudes = (len(axis) for axis in axes if axis is not None)
        count = times * latitudes * longitudes
        if count > MAX_VALUES:
            raise PydanticCustomError(
                "too_many",
                "{count} values exceed the limit of {limit}",
                {"count": count, "limit": MAX_VALUES},
            )
        planes = _parts(value, times)
        lines = [line for plane in planes for line in _parts(plane, latitudes)]
        for line in lines:
            _parts(line, longitudes)
        return value

    @field_validator(*_VARIABLES)
    @classmethod
    def _has_no_holes(cls, value: Any) -> Any:  # the values of one variable
        for at, number in _places(value or ()):
            if number is None:
                raise PydanticCustomError(
                    "hole",
                    "has no value at {at} (time, latitude, longitude): holes are not filled",
                    {"at": ", ".join(map(str, at))},
                )
        return value

    @model_validator(mode="after")
    def _has_one_wind(self) -> Self:
        by_speed = self.wind_speed_mps, self.wind_from_deg
        by_parts = self.eastward_wind_mps, self.northward_wind_mps
        given = [pair for pair in (by_speed, by_parts) if pair != (None, None)]
        if len(given) != 1 or None in given[0]:
            raise _fault(
                "wind_speed_mps",
                "the wind needs wind_speed_mps and wind_from_deg, or eastward_wind_mps and "
                "northward_wind_mps",
            )
        if given == [by_parts]:
            norths = _places(self.northward_wind_mps)
            for (at, east), (_, north) in zip(_places(self.eastward_wind_mps), norths, strict=True):
                if hypot(east or 0.0, north or 0.0) > MAX_WIND_MPS:
                    where = ", ".join(map(str, at))
                    speed = f"{hypot(east or 0.0, north or 0.0):.0f} m/s at {where}"
                    detail = f"{speed} exceeds the limit of {MAX_WIND_MPS:g} m/s"
                    raise _fault("eastward_wind_mps", detail)
        return self


def _parts(value: Any, count: int) -> list[Any]:  # any JSON value
    if not isinstance(value, list | tuple) or len(value) != count:
        found = f"{len(value)} values" if isinstance(value, list | tuple) else "no list"
        raise PydanticCustomError(
            "shape",
            "needs a list for each time, in it a list for each latitude, and in it a value for "
            "each longitude: found {found} where {count} values are needed",
            {"found": found, "count": count},
        )
    return list(value)


def _places(values: Any) -> Iterator[tuple[tuple[int, int, int], float | None]]:
    """Each value with its numbers of time, latitude and longitude, from 0."""
    for time, plane in enumerate(values):
        for row, line in enumerate(plane):
            for column, value in enumerate(line):
                yield (time, row, column), value


class PlaceReport(_FewMembers):
    """What a station of the network, or another place, reports for one time."""

    station_id: Annotated[
        StationId | None, Field(description="The station; without it the place is given.")
    ] = None
    latitude: Annotated[_Latitude | None, Field(description="Degrees north.")] = None
    longitude: Annotated[_Longitude | None, Field(description="Degrees east.")] = None
    valid_at: Annotated[Moment, Field(description="From when the values hold, as in a grid.")]
    wind_speed_mps: Annotated[_Wind, Field(description="Speed of the wind.")]
    wind_from_deg: Annotated[
        _Direction, Field(description="Where the wind comes from: 0 is north, 90 is east.")
    ]
    gust_mps: Annotated[_Wind | None, Field(description="Speed of gusts.")] = None
    temperature_c: Annotated[
        _Temperature | None, Field(description="Temperature of the air, degrees Celsius.")
    ] = None
    error_mps: Annotated[_Error | None, Field(description="Standard error of the wind.")] = None

    @model_validator(mode="after")
    def _has_one_place(self) -> Self:
        has_position = self.latitude is not None and self.longitude is not None
        has_part = self.latitude is not None or self.longitude is not None
        if has_position != has_part or has_position == (self.station_id is not None):
            raise _fault("station_id", "a report needs a station_id, or latitude and longitude")
        return self


class ForecastDocument(_FewMembers):
    """The body of PUT /v1/networks/{network_id}/weather: a grid, or reports from places."""

    source: Annotated[
        str,
        Field(
            min_length=1,
            max_length=100,
            pattern=r"^[^\x00-\x1f\x7f-\x9f]+$",
            description="Who measured or computed the values.",
            examples=["DWD ICON-D2"],
        ),
    ]
    issued_at: Annotated[Moment, Field(description="When the source issued the values.")]
    grid: Annotated[WeatherGrid | None, Field(description="Values on a grid.")] = None
    reports: Annotated[
        tuple[PlaceReport, ...] | None,
        Field(
            min_length=1,
            max_length=MAX_REPORTS,
            description="Reports from places; each place reports for each time.",
        ),
    ] = None

    @classmethod
    def measured(cls, values: Mapping[str, float], at: Moment, *, holds_s: float) -> Self:
        """Air as drones measured it, which counts everywhere; `values` by the grid's names."""
        grid: dict[str, Any] = {name: (((each,),),) * 2 for name, each in values.items()}
        # The values of the last time hold as long as those before it.
        time = at, at + timedelta(seconds=holds_s / 2)
        place = {"latitude": (0.0,), "longitude": (0.0,)}
        return cls(source=MEASURED, issued_at=at, grid=WeatherGrid(time=time, **place, **grid))

    @model_validator(mode="after")
    def _has_one_form(self) -> Self:
        if (self.grid is None) == (self.reports is None):
            raise _fault("grid", "a forecast is either a grid or reports")
        return self


class MeasuredWind(WireModel):
    """By how much the wind that drones measured differs from a forecast, at some of its places.

    Without a forecast it differs so much from still air, in the whole network: place 0.
    """

    at: FleetMoment
    places: tuple[tuple[int, float, float], ...]
    """The number of each place, and the difference to the east and to the north, in m/s."""


class WeatherNote(WireModel):
    """The weather that a plan uses."""

    source: Annotated[
        str, Field(description="Who computed the forecast, or MEASURED: drones in flight did.")
    ]
    issued_at: FleetMoment


class WeatherInForce(JsonModel):
    """The forecast that the plans of a network use, or the wind that its drones measure."""

    network_id: Annotated[NetworkId, Field(description="Id of the network.")]
    source: Annotated[
        str, Field(description="Who computed the forecast, or MEASURED: drones in flight did.")
    ]
    issued_at: FleetMoment
    age_s: Annotated[float, Field(description="Seconds since it was issued, fleet time.")]
    received_at: FleetMoment
    sha256: Annotated[
        str, Field(description="SHA-256 of the stored forecast; the same content has the same.")
    ]
    phase: Annotated[
        Literal["AHEAD", "VALID", "FADING", "OVER"],
        Field(
            description="AHEAD: its first time is still to come. VALID: its values count fully. "
            "FADING: its last time is over, and it counts less and less. OVER: the air counts as "
            "still."
        ),
    ]
    valid_from_at: FleetMoment
    valid_until_at: FleetMoment
    fades_until_at: FleetMoment
    measured_at: Annotated[
        FleetMoment | None,
        Field(description="When the wind that drones measured corrected it last; null if never."),
    ] = None
    places: Annotated[int, Field(description="Places for which there are values.")]
    times: Annotated[int, Field(description="Times for which there are values.")]
