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
    write(file, units="knots")
    with pytest.raises(InvalidInput, match="eastward_wind_mps: has the units 'knots'"):
        read_netcdf(str(file), stations=STATIONS, source=None)

    with Dataset(file, "w") as made:
        made.createDimension("time", 1)
    with pytest.raises(InvalidInput, match="time: the file has no such axis"):
        read_netcdf(str(file), stations=STATIONS, source=None)

    file.write_text("text")
    with pytest.raises(SkywayError, match="cannot be read"):
        read_netcdf(str(file), stations=STATIONS, source=None)
