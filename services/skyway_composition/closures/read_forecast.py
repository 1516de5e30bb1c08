"""Reads forecasts: whether a network accepts one, its periods, and its values as arrays."""

import hashlib
from datetime import timedelta
from typing import Any, Final

import numpy as np

from skyway.contracts.weather import MEASURED, ForecastDocument, PlaceReport, WeatherGrid
from skyway.errors import InvalidInput
from skyway.geo import wrapped_deg
from skyway.network.network import Network
from skyway.planner.forecast import FADING, FARTHEST_M, MILD_C, Forecast
from skyway.planner.kernels.memory import Floats
from skyway.units import moment_to_ms, ms_to_moment

#: The most segments times periods of a network: 6 million factors of time and of energy are 96 MB.
MOST_FACTORS: Final = 6_000_000

#: How far ahead the values of a forecast may end. Our own choice: no forecast of wind is of use so
#: long before, and later moments are soon beyond the calendar.
_FARTHEST_AHEAD: Final = timedelta(days=60)

#: How long the values of a single time hold, seconds.
_ONE_HOUR_S: Final = 3_600.0


def content_of(document: ForecastDocument) -> tuple[bytes, str]:
    """The forecast as it is stored, and its SHA-256."""
    content = document.model_dump_json(exclude_none=True).encode()
    return content, hashlib.sha256(content).hexdigest()


def edges_s(document: ForecastDocument) -> list[float]:
    """When each period of a forecast begins, and when the last one ends, seconds since 1970."""
    if document.grid is not None:
        moments = set(document.grid.time)
    else:
        moments = {each.valid_at for each in document.reports or ()}
    starts_s = sorted(moment_to_ms(each) / 1000 for each in moments)
    last_s = starts_s[-1] - starts_s[-2] if len(starts_s) > 1 else _ONE_HOUR_S
    return [*starts_s, starts_s[-1] + last_s]


def accepted(document: ForecastDocument, network: Network, *, now_ms: int) -> ForecastDocument:
    """The forecast, in which reports of stations have their positions, if a network can use it.

    Raises
    ------
    InvalidInput
        It is over, it ends or was issued too far in the future, it is for another area, its source
        is MEASURED, a place has no report for a time, or it has too many times for a network of
        this size.
    """
    form = "grid" if document.grid is not None else "reports"
    if document.source == MEASURED:
        raise InvalidInput("source", f"{MEASURED} is the air as drones measure it")
    edges = edges_s(document)
    if edges[-1] * 1000 <= now_ms:
        until, now = (ms_to_moment(round(each)).isoformat() for each in (edges[-1] * 1000, now_ms))
        raise InvalidInput(form, f"all values are past: they end at {until}, and now it is {now}")
    if edges[-1] > now_ms / 1000 + _FARTHEST_AHEAD.total_seconds():
        days = f"{(edges[-1] - now_ms / 1000) / 86_400:.0f} days"
        detail = f"values that hold for {days} exceed the limit of {_FARTHEST_AHEAD.days} days"
        raise InvalidInput(form, detail)
    if document.issued_at > ms_to_moment(now_ms) + timedelta(hours=1):
        detail = f"{document.issued_at.isoformat()} is more than 1 hour in the future"
        raise InvalidInput("issued_at", detail)
    periods, segments = len(edges) - 1 + len(FADING), len(network.columns.length_m)
    if periods * segments > MOST_FACTORS and periods > 1 + len(FADING):
        most = max(1, MOST_FACTORS // segments - len(FADING))
        count = f"{len(edges) - 1} times"
        detail = f"{count} exceed the limit of {most} for a network of {segments} segments"
        raise InvalidInput(form, detail)
    reports = document.reports and tuple(
        _placed(report, network, number) for number, report in enumerate(document.reports)
    )
    placed = document.model_copy(update={"reports": reports})
    forecast = forecast_of(placed)
    if not len(network.columns.longitude_deg):
        return placed
    row, far_m = forecast.farthest_m(network)
    if far_m > FARTHEST_M:
        station = network.columns.station_ids[row]
        detail = (
            f"station {station!r} is {far_m / 1000:.0f} km away from the area of the forecast, the "
            f"limit is {FARTHEST_M / 1000:g} km"
        )
        raise InvalidInput(form, detail)
    return placed


def forecast_of(document: ForecastDocument) -> Forecast:
    """The forecast in a document, whose reports have positions.

    Raises
    ------
    InvalidInput
        A place reports a time twice, or has no report for a time.
    """
    if document.grid is not None:
        return _of_grid(document.grid, edges_s(document))
    return _of_reports(document.reports or (), edges_s(document))


def _of_grid(grid: WeatherGrid, edges: list[float]) -> Forecast:
    rows, columns = len(grid.latitude), len(grid.longitude)

    def values(given: Any, default: float) -> Floats:  # nested tuples of one variable
        shape = (len(grid.time), rows * columns)
        if given is None:
            return np.full(shape, default)
        return np.array(given, np.float64).reshape(shape)

    if grid.wind_speed_mps is not None:
        east, north = _components(values(grid.wind_speed_mps, 0), values(grid.wind_from_deg, 0))
    else:
        east = values(grid.eastward_wind_mps, 0)
        north = values(grid.northward_wind_mps, 0)
    longitude_deg = np.array(grid.longitude)
    crossings = np.concatenate(([0], np.cumsum(np.diff(longitude_deg) < 0)))
    return Forecast(
        longitude_deg=np.tile(longitude_deg + 360.0 * crossings, rows),
        latitude_deg=np.repeat(np.array(grid.latitude), columns),
        edges_s=np.array(edges),
        east_mps=east,
        north_mps=north,
        gust_mps=values(grid.gust_mps, 0),
        temperature_c=values(grid.temperature_c, MILD_C),
        error_mps=values(grid.error_mps, 0),
        grid=(rows, columns),
    )


def _of_reports(reports: tuple[PlaceReport, ...], edges: list[float]) -> Forecast:
    times = {at_s: number for number, at_s in enumerate(edges[:-1])}
    places: dict[tuple[float, float], int] = {}
    found: dict[tuple[int, int], PlaceReport] = {}
    for number, report in enumerate(reports):
        place = places.setdefault(_place(report), len(places))
        key = times[moment_to_ms(report.valid_at) / 1000], place
        if key in found:
            raise InvalidInput(
                f"reports.{number}", "has the same place and time as an earlier report"
            )
        found[key] = report
    missing = next((key for key in np.ndindex(len(times), len(places)) if key not in found), None)
    if missing is not None:
        longitude_deg, latitude_deg = [*places][missing[1]]
        at = ms_to_moment(round(edges[missing[0]] * 1000)).isoformat()
        where = f"the place {latitude_deg}, {longitude_deg}"
        detail = f"{where} has no report for {at}: holes are not filled"
        raise InvalidInput("reports", detail)

    def values(name: str, default: float) -> Floats:
        column = np.full((len(times), len(places)), default)
        for key, report in found.items():
            value = getattr(report, name)
            column[key] = default if value is None else value
        return column

    east, north = _components(values("wind_speed_mps", 0), values("wind_from_deg", 0))
    positions = np.array([*places])
    return Forecast(
        longitude_deg=positions[:, 0],
        latitude_deg=positions[:, 1],
        edges_s=np.array(edges),
        east_mps=east,
        north_mps=north,
        gust_mps=values("gust_mps", 0),
        temperature_c=values("temperature_c", MILD_C),
        error_mps=values("error_mps", 0),
    )


def _components(speed_mps: Floats, from_deg: Floats) -> tuple[Floats, Floats]:
    """How fast the air moves to the east and to the north, from speed and direction."""
    from_rad = np.radians(from_deg)
    return -speed_mps * np.sin(from_rad), -speed_mps * np.cos(from_rad)


def _placed(report: PlaceReport, network: Network, number: int) -> PlaceReport:
    """The report with the position of its station instead of its id."""
    if report.station_id is None:
        return report
    station = network.stations.get(report.station_id)
    if station is None:
        detail = f"there is no station {report.station_id!r} in the network"
        raise InvalidInput(f"reports.{number}.station_id", detail)
    longitude_deg, latitude_deg = station.position
    place = {"station_id": None, "longitude": longitude_deg, "latitude": latitude_deg}
    return report.model_copy(update=place)


def place_count(document: ForecastDocument) -> int:
    """The number of places for which a forecast has values."""
    if document.grid is not None:
        return len(document.grid.latitude) * len(document.grid.longitude)
    return len({_place(each) for each in document.reports or ()})


def _place(report: PlaceReport) -> tuple[float, float]:
    """Longitude and latitude; 190 and -170 are one meridian."""
    return wrapped_deg(report.longitude or 0.0), report.latitude or 0.0
