"""NetCDF files of weather services become forecasts."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from netCDF4 import Dataset

from skyway.cli.weather_file import read_netcdf
from skyway.contracts.weather import ForecastDocument
from skyway.errors import InvalidInput, SkywayError
from skyway.geo import Position

#: Near the western border of the grid below.
STATIONS = [Position(-97.7, 30.2), Position(-97.3, 30.6)]


def write(
    file: Path, *, wind: str = "eastward_wind", units: str = "m s-1", form: Any = "NETCDF4"
) -> None:
    """A global model's file: longitudes 0 to 360, latitudes falling, Kelvin, a height of 10 m."""
    with Dataset(file, "w", format=form) as made:
        made.institution = "A weather\nservice"
        axes: dict[str, tuple[Any, str]] = {
            "time": ([0, 3], "hours since 2026-11-25 06:00:00"),
            "height": ([10.0], "m"),
            "lat": ([31.0, 30.5, 30.0, 29.5], "degrees_north"),
            "lon": ([262.0, 262.5, 263.0, 263.5], "degrees_east"),
        }
        for name, (values, unit) in axes.items():
            made.createDimension(name, len(values))
            variable = made.createVariable(name, "f8", (name,))
            variable[:] = values
            variable.units = unit
        shape = (2, 1, 4, 4)
        numbers = np.arange(32.0).reshape(shape)
        for name, standard, values, unit in (
            ("u", wind, numbers / 10, units),
            ("v", "northward_wind", -numbers / 10, units),
            ("t", "air_temperature", 273.15 + numbers, "K"),
        ):
            variable = made.createVariable(name, "f4", tuple(axes), fill_value=-9999.0)
            variable.standard_name, variable.units = standard, unit
            variable[:] = values


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_CLASSIC"])
def test_a_netcdf_file_is_cut_sorted_and_converted_to_our_units(tmp_path: Path, form: str) -> None:
    write(tmp_path / "model.nc", form=form)

    found = read_netcdf(str(tmp_path / "model.nc"), stations=STATIONS, source=None)

    assert found["source"] == "A weather service"
    assert found["issued_at"] == "2026-11-25T06:00:00+00:00"
    grid = found["grid"]
    assert grid["time"] == ["2026-11-25T06:00:00+00:00", "2026-11-25T09:00:00+00:00"]
    assert (grid["latitude"], grid["longitude"]) == ([30.0, 30.5, 31.0], [-98.0, -97.5, -97.0])
    assert grid["eastward_wind_mps"][0] == [[0.8, 0.9, 1.0], [0.4, 0.5, 0.6], [0.0, 0.1, 0.2]]
    assert grid["temperature_c"][1][2] == pytest.approx([16.0, 17.0, 18.0])
    assert ForecastDocument.model_validate(found).grid is not None


def test_a_hole_stays_a_hole_so_that_the_server_names_it(tmp_path: Path) -> None:
    write(tmp_path / "model.nc")
    with Dataset(tmp_path / "model.nc", "a") as made:
        made["u"][0, 0, 2, 0] = np.ma.masked

    found = read_netcdf(str(tmp_path / "model.nc"), stations=STATIONS, source="ours")

    assert found["source"] == "ours"
    assert found["grid"]["eastward_wind_mps"][0][0][0] is None


def test_files_that_hold_no_forecast_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "model.nc"
    write(file, units="furlongs")
    with pytest.raises(InvalidInput, match="eastward_wind_mps: u has the units 'furlongs'"):
        read_netcdf(str(file), stations=STATIONS, source=None)

    with Dataset(file, "w") as made:
        made.createDimension("time", 1)
    with pytest.raises(InvalidInput, match="time: the file has no such axis"):
        read_netcdf(str(file), stations=STATIONS, source=None)

    file.write_text("text")
    with pytest.raises(SkywayError, match="cannot be read as NetCDF"):
        read_netcdf(str(file), stations=STATIONS, source=None)


class Model(dict[str, dict[str, Any]]):
    """A small file: variables with dimensions, values and attributes, which a test changes."""

    def __init__(self) -> None:
        wind = {
            "dims": ("time", "lat", "lon"),
            "values": np.full((2, 2, 2), 36.0),
            "units": "m s-1",
        }
        super().__init__(
            time={"dims": ("time",), "values": [18, 21], "units": "hours since 2026-11-28"},
            lat={"dims": ("lat",), "values": [31, 29], "units": "degrees_north"},
            lon={"dims": ("lon",), "values": [261, 263], "units": "degrees_east"},
            u={**wind, "standard_name": "eastward_wind"},
            v={**wind, "standard_name": "northward_wind"},
        )

    def add(self, name: str, dims: tuple[str, ...], values: Any, **attributes: Any) -> None:
        self[name] = {"dims": dims, "values": values, **attributes}

    def both(self, **changes: Any) -> Any:
        for name in ("u", "v"):
            self[name] |= changes

    def read(self, folder: Path, **options: Any) -> Any:
        file = folder / "small.nc"
        with Dataset(file, "w") as made:
            for name, given in self.items():
                values = np.ma.asarray(given["values"])
                for dimension, length in zip(given["dims"], values.shape, strict=True):
                    if dimension not in made.dimensions:
                        made.createDimension(dimension, length)
                kind = str if values.dtype.kind == "U" else "f8"
                variable = made.createVariable(name, kind, given["dims"])
                variable.setncatts({k: v for k, v in given.items() if k not in ("dims", "values")})
                variable[...] = np.asarray(values, object) if kind is str else values
        return read_netcdf(str(file), stations=[], source=None, **options)["grid"]


def one_step() -> Model:
    """As cfgrib writes a single step: reference time and valid time, both as coordinates."""
    model, since = Model(), "hours since 2026-11-28"
    model.add("time", (), 0, units=since, standard_name="forecast_reference_time")
    model.add("step", ("step",), [18], units="hours", standard_name="forecast_period")
    model.add("valid_time", ("step",), [18], units=since, standard_name="time")
    model.both(dims=("step", "lat", "lon"), values=np.full((1, 2, 2), 4.0))
    return model


def two_heights(*, units: str = "m", heights: Any = (10, 100)) -> Model:
    model = Model()
    model.add("h", ("h",), heights, units=units, standard_name="height", positive="up")
    values = np.stack([np.full((2, 2, 2), 5.0), np.full((2, 2, 2), 9.0)], axis=1)
    model.both(dims=("time", "h", "lat", "lon"), values=values)
    return model


def test_the_valid_time_counts_not_the_reference_time(tmp_path: Path) -> None:
    assert one_step().read(tmp_path)["time"] == ["2026-11-28T18:00:00+00:00"]


@pytest.mark.parametrize(
    ("units", "mps"),
    [("km h-1", 10.0), ("knots", 18.52), ("kt", 18.52), ("m s**-1", 36.0), ("cm/s", 0.36)],
)
def test_speeds_are_converted(tmp_path: Path, units: str, mps: float) -> None:
    model = Model()
    model.both(units=units)

    assert model.read(tmp_path)["eastward_wind_mps"][0][0][0] == mps


def test_the_wind_is_that_of_10_metres_or_of_the_named_height(tmp_path: Path) -> None:
    assert two_heights().read(tmp_path)["eastward_wind_mps"][0][0][0] == 5.0
    assert two_heights().read(tmp_path, height_m=100)["northward_wind_mps"][0][0][0] == 9.0
    km = two_heights(units="km", heights=(0.1, 0.01))
    assert km.read(tmp_path)["eastward_wind_mps"][0][0][0] == 9.0


def test_values_of_a_span_hold_from_its_beginning(tmp_path: Path) -> None:
    model = Model()
    model["time"]["bounds"] = "span"
    model.add("span", ("time", "ends"), [[15, 18], [18, 21]])
    model.both(cell_methods="time: mean")

    assert model.read(tmp_path)["time"][0] == "2026-11-28T15:00:00+00:00"


def ambiguous(name: str) -> Model:
    """A model with one thing that makes it unreadable."""
    model = Model()
    missing = np.ma.masked_array([18, 21], mask=[False, True])
    points = {"dims": ("time", "place"), "values": np.ones((2, 3))}
    changes: dict[str, Any] = {
        "two heights, none of 10": lambda: model.update(two_heights(heights=(80, 100))),
        "winds of two heights": lambda: (
            model["u"].update(long_name="10 metre U wind"),
            model["v"].update(long_name="100 metre V wind"),
        ),
        "pressures": lambda: model.update(two_heights(units="hPa", heights=(850, 1000))),
        "two winds": lambda: model.update(u2=dict(model["u"])),
        "members": lambda: model.both(
            dims=("member", "time", "lat", "lon"), values=np.ones((2, 2, 2, 2))
        ),
        "no wind": lambda: model.pop("v"),
        "time without units": lambda: model["time"].pop("units"),
        "time in hours": lambda: model["time"].update(units="hours"),
        "masked time": lambda: model["time"].update(values=missing),
        "endless time": lambda: model["time"].update(values=[1e18, 2e18]),
        "noleap": lambda: model["time"].update(calendar="noleap"),
        "360_day": lambda: model["time"].update(calendar="360_day"),
        "two times": lambda: model.update(valid_time=dict(model["time"])),
        "points": lambda: (
            model["lat"].update(dims=("place",), values=[29, 30, 31]),
            model["lon"].update(dims=("place",), values=[261, 262, 263]),
            model.both(**points),
        ),
        "metres": lambda: model["lat"].update(units="m"),
        "no degrees": lambda: model["lon"].pop("units"),
        "NaN in an axis": lambda: model["lat"].update(values=[29, float("nan")]),
        "beyond the pole": lambda: model["lat"].update(values=[29, 129]),
        "words": lambda: model["lat"].update(values=["a", "b"]),
        "wind without units": lambda: model["u"].pop("units"),
        "wind of a temperature": lambda: model["u"].update(units="K"),
        "share": lambda: model["u"].update(units="%"),
        "turned": lambda: model["u"].update(dims=("lat", "lon", "x"), values=np.ones((2, 2, 1))),
    }
    changes[name]()
    return model


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("two heights, none of 10", "height 80 m, u at height 100 m.*--height-m"),
        ("winds of two heights", "not of one height"),
        ("pressures", "height 850 hPa"),
        ("two winds", "u at .*, u2 at "),
        ("members", "more than one value of member"),
        ("no wind", "neither eastward_wind"),
        ("time without units", "time: time has the units ''"),
        ("time in hours", "time: time has the units 'hours'"),
        ("masked time", "time: time has missing values"),
        ("endless time", "moments that cannot be"),
        ("noleap", "calendar 'noleap'"),
        ("360_day", "calendar '360_day'"),
        ("two times", "several such axes: time, valid_time"),
        ("points", "places along one dimension"),
        ("metres", "latitude: lat has the units 'm'"),
        ("no degrees", "longitude: lon has the units ''"),
        ("NaN in an axis", "lat has missing values"),
        ("beyond the pole", "beyond 90 degrees"),
        ("words", "lat holds no numbers"),
        ("wind without units", "u has the units ''"),
        ("wind of a temperature", "u has the units 'K'"),
        ("share", "u has the units '%'"),
        ("turned", "u has no values along time"),
    ],
)
def test_what_is_ambiguous_is_refused_by_name(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(InvalidInput, match=says):
        ambiguous(name).read(tmp_path)
