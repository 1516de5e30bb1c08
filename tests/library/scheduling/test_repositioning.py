"""Where a drone waits for its next request, given past requests and the drones that wait."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.geo import Position, distance_m
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.scheduling.repositioning import PastRequest, expected_pickups, places_to_wait
from skyway.units import hours_to_s

HOUR_MS: Final = round(hours_to_s(1) * 1000)
#: As in the module: how often a drone is busy.
BUSY: Final = 0.75
#: Rounding of lengths, metres.
SAME_M: Final = 0.1
NAMES: Final = [StationId(name) for name in "abcdefgh"]

Counts = Mapping[StationId, int]


def make_row(*, pads: Mapping[str, int] | None = None) -> Network:
    """Stations in a row, 0.1 degrees apart, connected to their neighbours; one pad each."""
    stations = {
        name: Station(name, Position(0.1 * number, 0.0), pads=(pads or {}).get(name, 1))
        for number, name in enumerate(NAMES)
    }
    pairs = [*pairwise(NAMES), *pairwise(reversed(NAMES))]
    return Network(stations, tuple(Segment(one, other, 12_000.0) for one, other in pairs))


def places(
    pickups: Mapping[str, float], waiting: Mapping[str, int], *, start: str, network: Network
) -> str:
    found = places_to_wait(
        network,
        {StationId(each): chance for each, chance in pickups.items()},
        waiting={StationId(each): count for each, count in waiting.items()},
        start=StationId(start),
        otherwise=StationId(start),
    )
    return "".join(found)


def requests(station_id: str, *, count: int = 10, at_ms: int = 0) -> list[PastRequest]:
    return [PastRequest(StationId(station_id), at_ms)] * count


def test_a_drone_waits_where_the_next_pickup_is_expected() -> None:
    assert places({"b": 1.0}, {"a": 9}, start="d", network=make_row()) == "b"


def test_several_drones_wait_where_the_next_pickups_are_expected_if_there_are_pads() -> None:
    network, waiting = make_row(pads={"b": 3}), {"a": 9, "b": 2}

    assert places({"b": 1.0}, waiting, start="c", network=network) == "b"
    assert places({"b": 1.0}, waiting, start="c", network=make_row()) == ""


def test_a_drone_does_not_fly_far_for_a_rare_pickup() -> None:
    assert places({"a": 0.02, "h": 0.98}, {"g": 1}, start="h", network=make_row()) == ""


def test_the_work_does_not_grow_with_the_neighbours_of_a_pickup() -> None:
    """The nearest of 600 neighbours comes last, and is not compared any more."""
    hub = Station(StationId("hub"), Position(0.0, 0.0), pads=0)
    ends = [
        Station(StationId(f"end{number:03}"), Position(0.1 - number / 10_000, 0.0), pads=1)
        for number in range(600)
    ]
    segments = [Segment(hub.station_id, each.station_id, 12_000.0) for each in ends]
    network = Network({each.station_id: each for each in (hub, *ends)}, tuple(segments))

    found = places_to_wait(
        network,
        {hub.station_id: 1.0},
        waiting={},
        start=hub.station_id,
        otherwise=StationId("end000"),
    )

    assert found[0] == "end499"


def test_a_drone_waits_only_at_stations_with_pads() -> None:
    assert places({"b": 1.0}, {"h": 9}, start="d", network=make_row(pads={"b": 0})) == "c"


def test_no_pickup_is_expected_after_fewer_than_ten_requests() -> None:
    assert expected_pickups(requests("a", count=9), at_ms=0) == {}
    assert expected_pickups([], at_ms=0) == {}
    assert expected_pickups(requests("a"), at_ms=0) == {"a": 1.0}


def test_no_pickup_is_expected_from_requests_that_are_decades_old() -> None:
    assert expected_pickups(requests("a"), at_ms=100 * 365 * 24 * HOUR_MS) == {}


def test_recent_requests_count_more_than_old_ones() -> None:
    old, recent = requests("a", at_ms=0), requests("b", at_ms=14 * 24 * HOUR_MS)

    chances = expected_pickups([*old, *recent], at_ms=14 * 24 * HOUR_MS)

    assert chances == pytest.approx({"b": 0.8, "a": 0.2})


def test_requests_at_the_same_hour_of_the_day_count_most() -> None:
    morning, evening = requests("a", at_ms=8 * HOUR_MS), requests("b", at_ms=20 * HOUR_MS)

    chances = expected_pickups([*morning, *evening], at_ms=(24 + 8) * HOUR_MS)

    assert chances[StationId("a")] > 0.9


#: At most 16 drones in all: of more, only those nearest to a pickup count.
counts: Final = st.dictionaries(st.sampled_from(NAMES), st.integers(0, 3), max_size=5)
chances: Final = st.dictionaries(
    st.sampled_from(NAMES), st.floats(0.01, 1.0), min_size=1, max_size=6
)


@settings(max_examples=60)
@given(chances, counts, st.sampled_from(NAMES), st.sampled_from(NAMES))
def test_no_place_costs_more_energy_than_its_approaches_save(
    pickups: Mapping[StationId, float], waiting: Counts, start: StationId, otherwise: StationId
) -> None:
    network = make_row(pads={name: number % 3 for number, name in enumerate(NAMES)})

    found = places_to_wait(network, pickups, waiting=waiting, start=start, otherwise=otherwise)

    def apart_m(one: StationId, other: StationId) -> float:
        return distance_m(network.stations[one].position, network.stations[other].position)

    def approach_m(place: StationId) -> float:
        drones = [place, *(each for each, count in waiting.items() for _ in range(count))]
        return sum(
            chance * (1 - BUSY) * BUSY**rank * length_m
            for pickup, chance in pickups.items()
            for rank, length_m in enumerate(sorted(apart_m(each, pickup) for each in drones))
        )

    saved = [approach_m(otherwise) - approach_m(place) for place in found]
    drones = 1 + sum(waiting.values())
    for place, saved_m in zip(found, saved, strict=True):
        longer_m = apart_m(start, place) - apart_m(start, otherwise)
        assert saved_m > 0
        assert longer_m <= drones * saved_m + SAME_M
        assert waiting.get(place, 0) < network.stations[place].pads
    assert saved == sorted(saved, reverse=True) or max(saved) - min(saved) < SAME_M
    again = places_to_wait(
        network,
        dict(reversed([*pickups.items()])),
        waiting=dict(reversed([*waiting.items()])),
        start=start,
        otherwise=otherwise,
    )
    assert again == found
