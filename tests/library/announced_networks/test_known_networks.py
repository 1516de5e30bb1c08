"""What is known of stations and ways, and of which networks they are."""

import pytest

from skyway.announced_networks.known_networks import KnownNetworks
from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.ids import NetworkId, StationId


def make_network(network_id: str = "city", *, version: int = 1, **parts: int) -> NetworkStations:
    return NetworkStations(
        network_id=NetworkId(network_id),
        version=version,
        station_ids=tuple(StationId(each) for each in parts),
        positions=tuple(Position(0.0, float(number)) for number in range(len(parts))),
        parts=tuple(parts.values()),
    )


def start_of_ways(known: KnownNetworks, start: str, *ends: str) -> Position | None:
    return known.start_of_ways(StationId(start), to=[StationId(end) for end in ends])


@pytest.fixture
def known() -> KnownNetworks:
    """Two networks: a city with an island, and a town."""
    made = KnownNetworks()
    made.keep(make_network(a=0, b=0, island=2))
    made.keep(make_network("town", t=0))
    return made


def test_ways_within_a_part_of_a_network_are_known(known: KnownNetworks) -> None:
    assert start_of_ways(known, "b", "a", "b") == Position(0.0, 1.0)


@pytest.mark.parametrize(
    ("start", "end"), [("a", "island"), ("a", "t"), ("a", "new"), ("new", "a")]
)
def test_other_ways_are_not(known: KnownNetworks, start: str, end: str) -> None:
    assert start_of_ways(known, start, end) is None


@pytest.mark.parametrize(("station", "network"), [("island", "city"), ("t", "town"), ("new", None)])
def test_a_station_is_of_the_network_that_has_it(
    known: KnownNetworks, station: str, network: str | None
) -> None:
    assert known.network_of(StationId(station)) == network


def test_a_new_version_replaces_what_was_known(known: KnownNetworks) -> None:
    known.keep(make_network(version=2, b=0, c=0))

    assert known.version_of(NetworkId("city")) == 2
    assert [known.network_of(StationId(each)) for each in "abc"] == [None, "city", "city"]


def test_nothing_is_known_of_a_network_that_was_dropped(known: KnownNetworks) -> None:
    known.drop(NetworkId("city"))

    assert known.version_of(NetworkId("city")) is None
    assert [known.network_of(StationId(each)) for each in "at"] == [None, "town"]


def test_stations_beyond_what_may_be_kept_are_not_known(known: KnownNetworks) -> None:
    ids = tuple(StationId(f"s{number}") for number in range(199_997))
    told = NetworkStations(
        network_id=NetworkId("country"),
        version=1,
        station_ids=ids,
        positions=(Position(0.0, 0.0),) * len(ids),
        parts=(0,) * len(ids),
    )

    known.keep(told)

    assert known.version_of(told.network_id) == 1
    assert known.network_of(ids[0]) is None
    assert known.network_of(StationId("a")) == "city"


def test_every_change_is_another_revision(known: KnownNetworks) -> None:
    seen = [known.revision]
    known.keep(make_network(version=2, a=0))
    seen.append(known.revision)
    known.drop(NetworkId("city"))
    seen.append(known.revision)
    known.forget()
    seen.append(known.revision)

    assert len(set(seen)) == 4
