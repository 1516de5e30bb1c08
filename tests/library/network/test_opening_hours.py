"""Opening hours: weekly spans, exceptions and time zones, as moments; faults by their field."""

import json
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest

from skyway.errors import InvalidNetwork
from skyway.ids import StationId
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_text import network_text, read_network_text
from skyway.network.opening_hours import OpeningHours, read_opening_hours

WORKDAYS = {day: ["08:00-12:00", "13:00-17:30"] for day in ("mon", "tue", "wed", "thu", "fri")}


def hours(**members: Any) -> OpeningHours:
    return read_opening_hours({"weekly": WORKDAYS, **members}, "hours")


def at(day: int, hour: int, minute: int = 0, month: int = 3) -> datetime:
    return datetime(2026, month, day, hour, minute, tzinfo=UTC)


def test_a_missing_weekday_is_closed_all_day() -> None:
    # 6 March 2026 is a Friday.
    assert hours().open_times(at(6, 0), at(9, 9)) == [
        (at(6, 8), at(6, 12)),
        (at(6, 13), at(6, 17, 30)),
        (at(9, 8), at(9, 9)),
    ]


def test_an_exception_replaces_the_hours_of_its_date() -> None:
    special = hours(exceptions={"2026-03-06": ["10:00-11:00"], "2026-03-09": []})

    assert special.open_times(at(6, 0), at(10, 0)) == [(at(6, 10), at(6, 11))]


def test_hours_are_wall_times_of_their_zone_across_the_change_of_clocks() -> None:
    chicago = hours(time_zone="America/Chicago")

    # Clocks go forward on 8 March 2026.
    assert chicago.open_times(at(6, 0), at(6, 18))[0][0] == at(6, 14)
    assert chicago.open_times(at(9, 0), at(9, 17))[0][0] == at(9, 13)


def test_a_wall_time_that_the_clock_skips_counts_as_if_it_had_not_been_set() -> None:
    night = read_opening_hours(
        {"time_zone": "America/Chicago", "weekly": {"sun": ["02:10-02:50", "03:00-04:00"]}}, "hours"
    )

    assert night.open_times(at(8, 0), at(9, 0)) == [(at(8, 8), at(8, 9))]


def test_spans_that_touch_at_midnight_are_one_time() -> None:
    night = read_opening_hours(
        {"weekly": {"mon": ["20:00-24:00"], "tue": ["00:00-06:00"]}}, "hours"
    )

    assert night.open_times(at(9, 12), at(10, 12)) == [(at(9, 20), at(10, 6))]


@pytest.mark.parametrize(
    ("hour", "minute", "is_open"), [(7, 59, False), (8, 0, True), (12, 0, False), (17, 29, True)]
)
def test_a_station_is_open_from_the_first_until_before_the_last_moment(
    hour: int, minute: int, is_open: bool
) -> None:
    assert hours().is_open(at(9, hour, minute)) is is_open


def test_times_are_cut_to_the_asked_span() -> None:
    assert hours().open_times(at(9, 9), at(9, 10)) == [(at(9, 9), at(9, 10))]


@pytest.mark.parametrize(
    ("document", "field", "detail"),
    [
        ([], "hours", "an array is not an object"),
        ({}, "hours.weekly", "is missing"),
        ({"weekly": {}}, "hours.weekly", "so the station would never open"),
        ({"weekly": {"mon": []}, "exceptions": {"2026-03-02": []}}, "hours.weekly", "never open"),
        ({"weekly": {}, "holidays": []}, "hours.holidays", "is none of time_zone, weekly"),
        ({"weekly": {"monday": []}}, "hours.weekly.monday", "is none of mon, tue"),
        ({"weekly": {"mon": "08:00-12:00"}}, "hours.weekly.mon", "is not an array"),
        ({"weekly": {"mon": ["8-12"]}}, "hours.weekly.mon.0", "is not a span such as"),
        ({"weekly": {"mon": ["-8:00-12:00"]}}, "hours.weekly.mon.0", "is not a span such as"),
        ({"weekly": {"mon": ["18:00-09:00"]}}, "hours.weekly.mon.0", "ends before it begins"),
        ({"weekly": {"mon": ["09:00-09:00"]}}, "hours.weekly.mon.0", "ends before it begins"),
        ({"weekly": {"mon": ["09:00-24:01"]}}, "hours.weekly.mon.0", "leaves the day"),
        ({"weekly": {"mon": ["09:60-10:00"]}}, "hours.weekly.mon.0", "leaves the day"),
        (
            {"weekly": {"mon": ["08:00-12:00", "11:59-13:00"]}},
            "hours.weekly.mon.1",
            "'11:59-13:00' begins before '08:00-12:00' ends",
        ),
        ({"weekly": {"mon": ["08:00-08:01"] * 13}}, "hours.weekly.mon", "exceed the limit of 12"),
        (
            {"weekly": {}, "time_zone": "Mars/Olympus"},
            "hours.time_zone",
            "is not the name of a time zone",
        ),
        ({"weekly": {}, "time_zone": "../etc/passwd"}, "hours.time_zone", "is not the name"),
        (
            {"weekly": {}, "exceptions": {"2026-02-30": []}},
            "hours.exceptions",
            "'2026-02-30' is not a date such as 2026-12-24",
        ),
        ({"weekly": {}, "exceptions": {"20260228": []}}, "hours.exceptions", "is not a date"),
    ],
)
def test_a_fault_is_named_by_its_field(document: Any, field: str, detail: str) -> None:
    with pytest.raises(InvalidNetwork) as raised:
        read_opening_hours(document, "hours")

    assert raised.value.field == field
    assert detail in raised.value.detail


def network_with(opening_hours: Any) -> dict[str, Any]:
    properties = {
        "kind": "station",
        "station_id": "a",
        "pads": 1,
        "opening_hours": opening_hours,
    }
    point = {"type": "Point", "coordinates": [0.0, 0.0]}
    feature = {"type": "Feature", "geometry": point, "properties": properties}
    return {"type": "FeatureCollection", "features": [feature]}


def test_a_network_keeps_the_opening_hours_of_its_stations() -> None:
    document = network_with({"weekly": WORKDAYS, "exceptions": {"2026-12-25": []}})

    for network in (
        read_network(document),
        read_network_text(json.dumps(document)),
        read_network_text(network_text(read_network(document))),
        read_network(write_network(read_network(document))),
    ):
        assert network.opening_hours[StationId("a")].exceptions == ((date(2026, 12, 25), ()),)


@pytest.mark.parametrize("read", [read_network, lambda each: read_network_text(json.dumps(each))])
def test_wrong_opening_hours_of_a_network_are_named_by_their_path(read: Any) -> None:
    with pytest.raises(InvalidNetwork) as raised:
        read(network_with({"weekly": {"mon": ["18:00-09:00"]}}))

    assert raised.value.field == "features.0.properties.opening_hours.weekly.mon.0"


def test_open_times_of_many_years_stay_in_order() -> None:
    times = hours(time_zone="Europe/Berlin").open_times(at(1, 0), at(1, 0) + timedelta(days=730))

    assert all(before[1] < after[0] for before, after in pairwise(times))
