"""Drones in another network than the pickup's do not displace other drones.

Each network's drones are counted for its status.
"""

from collections.abc import Sequence
from typing import Any

import pytest
from skyway_provider_registry.candidates.fleet_view import Fleet, FleetColumns, count_drones
from skyway_provider_registry.candidates.reasons import CachedDrone, CachedProvider
from skyway_provider_registry.candidates.selection import select as select_from

from skyway.announced_networks import CachedNetworks
from skyway.contracts.candidate import CandidateQuery
from skyway.contracts.shortlist import Candidates
from skyway.contracts.station_check import NetworkStations
from skyway.delivery.offer import Tariff
from skyway.delivery.qos import ProviderChoice
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_SCENARIO
from skyway.geo import Position
from skyway.ids import DroneId, NetworkId, ProviderId, StationId

#: All stations are at one place.
PLACE = Position(-97.94, 29.88)
NOW_MS = 1_000
#: Charged below the reserve of its model.
LOW: dict[str, object] = {"soc": 0.05, "model": DJI_MATRICE_300_RTK}


def make_network(network_id: str, *stations: str, version: int = 1) -> NetworkStations:
    return NetworkStations(
        network_id=NetworkId(network_id),
        version=version,
        station_ids=tuple(StationId(each) for each in stations),
        positions=(PLACE,) * len(stations),
        parts=(0,) * len(stations),
    )


@pytest.fixture
def networks() -> CachedNetworks:
    """Two networks, `a` and `c`, of two stations each."""
    cached = CachedNetworks()
    cached.put(make_network("a", "a-s1", "a-s2"))
    cached.put(make_network("c", "c-s1", "c-s2"))
    return cached


def make_drone(
    name: str, station: str | None, *, away_deg: float = 0.0, **members: Any
) -> CachedDrone:
    members_by_name: dict[str, Any] = {
        "drone_id": DroneId(name),
        "provider_id": ProviderId("p"),
        "model": PAPER_SCENARIO,
        "home_station_id": StationId("home"),
        "online_until_ms": NOW_MS,
        "station_id": station,
        "position": Position(PLACE.longitude_deg + away_deg, PLACE.latitude_deg),
        "soc": 0.9,
        "is_busy": False,
        **members,
    }
    return CachedDrone(**members_by_name)


def make_columns(networks: CachedNetworks, *drones: CachedDrone) -> FleetColumns:
    columns = FleetColumns(networks)
    columns.put(drones)
    return columns


def select(columns: FleetColumns, *, pickup: str = "a-s1", **members: object) -> Candidates:
    query = CandidateQuery.model_validate(
        {
            "pickup_station_id": pickup,
            "pickup_position": PLACE,
            "payload_kg": 2.0,
            "providers": ProviderChoice(),
            **members,
        }
    )
    name = ProviderId("p")
    providers = {name: CachedProvider(provider_id=name, tariff=Tariff(), is_active=True)}
    return select_from(query, Fleet(providers, columns), wall_now_ms=NOW_MS, now_ms=NOW_MS)


def chosen(found: Candidates) -> Sequence[str]:
    return found.shortlist.drone_ids


def reasons_of(found: Candidates) -> list[tuple[str, bool]]:
    return [(reason.code, reason.is_temporary) for reason in found.infeasible]


def test_drones_of_another_network_take_no_place_however_near_and_full(
    networks: CachedNetworks,
) -> None:
    foreign = [make_drone(f"c{number}", "c-s1", soc=1.0) for number in range(500)]
    own = [make_drone(f"a{number}", "a-s2", away_deg=0.5) for number in range(3)]

    found = select(make_columns(networks, *foreign, *own))

    assert chosen(found) == ("a0", "a1", "a2")
    assert found.infeasible == ()


def test_a_provider_with_drones_in_another_network_only_is_given_one_station(
    networks: CachedNetworks,
) -> None:
    found = select(make_columns(networks, make_drone("c0", "c-s1"), make_drone("c1", "c-s1")))

    (reason,) = found.infeasible
    assert (reason.provider_id, reason.code) == ("p", "DESTINATION_UNREACHABLE")
    assert reason.detail == "station 'c-s1' is not in network 'a'"
    assert not reason.is_temporary


def test_a_drone_at_an_uncached_station_is_compared(networks: CachedNetworks) -> None:
    assert chosen(select(make_columns(networks, make_drone("d", "new")))) == ("d",)


def test_all_drones_are_compared_for_an_uncached_pickup(networks: CachedNetworks) -> None:
    columns = make_columns(networks, make_drone("a0", "a-s1"), make_drone("c0", "c-s1"))

    assert chosen(select(columns, pickup="new")) == ("a0", "c0")


def test_a_newly_cached_network_counts_for_drones_that_already_stand_there() -> None:
    networks = CachedNetworks()
    columns = make_columns(networks, make_drone("a0", "a-s1"), make_drone("c0", "c-s1"))
    before = chosen(select(columns))

    networks.put(make_network("a", "a-s1"))
    networks.put(make_network("c", "c-s1"))

    assert (before, chosen(select(columns))) == (("a0", "c0"), ("a0",))


def test_a_network_that_left_the_cache_excludes_no_drone(networks: CachedNetworks) -> None:
    columns = make_columns(networks, make_drone("c0", "c-s1"))
    before = chosen(select(columns))

    networks.drop(NetworkId("c"))

    assert (before, chosen(select(columns))) == ((), ("c0",))


def test_a_station_may_change_its_network(networks: CachedNetworks) -> None:
    columns = make_columns(networks, make_drone("d", "c-s1"))
    before = chosen(select(columns))

    networks.put(make_network("c", "c-s2", version=2))
    networks.put(make_network("a", "a-s1", "c-s1", version=2))

    assert (before, chosen(select(columns))) == ((), ("d",))


def test_a_drone_that_has_moved_counts_where_it_stands_now(networks: CachedNetworks) -> None:
    columns = make_columns(networks, make_drone("d", "c-s1"), make_drone("e", "a-s1"))
    before = chosen(select(columns))

    columns.put([make_drone("d", "a-s2"), make_drone("e", "c-s2")])

    assert (before, chosen(select(columns))) == (("e",), ("d",))


@pytest.mark.parametrize(
    ("station", "state"),
    [
        ("a-s2", {"is_busy": True}),
        ("a-s2", LOW),
        ("a-s2", {"online_until_ms": 0}),
        # It flies, so its network is unknown.
        (None, {}),
    ],
)
def test_another_drone_of_the_provider_is_worth_asking_later(
    networks: CachedNetworks, station: str | None, state: dict[str, Any]
) -> None:
    other = make_drone("d", station, **state)
    columns = make_columns(networks, make_drone("c0", "c-s1"), other)

    (reason,) = select(columns).infeasible

    assert reason.is_temporary


@pytest.mark.parametrize("state", [{"is_busy": True}, LOW, {"online_until_ms": 0}])
def test_a_drone_of_another_network_is_never_a_later_candidate(
    networks: CachedNetworks, state: dict[str, Any]
) -> None:
    foreign = make_drone("c0", "c-s1", **state)

    alone = select(make_columns(networks, foreign))
    beside = select(make_columns(networks, foreign, make_drone("a0", "a-s1")))

    assert reasons_of(alone) == [("DESTINATION_UNREACHABLE", False)]
    assert (chosen(beside), beside.more_later) == (("a0",), ())


def test_strong_drones_of_another_network_do_not_prevent_splitting(
    networks: CachedNetworks,
) -> None:
    weak = make_drone("a0", "a-s1", model=DJI_MATRICE_300_RTK)
    columns = make_columns(networks, make_drone("c0", "c-s1"), weak)

    assert chosen(select(columns, payload_kg=5.0, heaviest_kg=2.0)) == ("a0",)


def test_only_drones_that_could_lift_it_are_reported_as_unreachable(
    networks: CachedNetworks,
) -> None:
    weak = make_drone("c0", "c-s1", model=DJI_MATRICE_300_RTK)
    own = make_drone("a0", "a-s1", model=DJI_MATRICE_300_RTK)

    too_heavy = select(make_columns(networks, weak, own), payload_kg=5.0)
    elsewhere = select(make_columns(networks, make_drone("c1", "c-s1"), own), payload_kg=5.0)

    assert reasons_of(too_heavy) == [("OVERWEIGHT", False)]
    assert reasons_of(elsewhere) == [("DESTINATION_UNREACHABLE", False)]


def test_drones_are_counted_in_the_network_where_they_stand(networks: CachedNetworks) -> None:
    columns = make_columns(
        networks,
        make_drone("idle", "a-s1"),
        make_drone("busy", "a-s2", is_busy=True),
        make_drone("free later", "a-s2", free_ms=NOW_MS + 1),
        make_drone("low", "a-s1", soc=-0.1),
        make_drone("silent", "a-s1", online_until_ms=NOW_MS - 1),
        make_drone("in the air", None, is_busy=True, home_station_id=StationId("a-s1")),
        make_drone("other model", "a-s1", model=DJI_MATRICE_300_RTK),
        make_drone("other network", "c-s1", home_station_id=StationId("a-s1")),
        make_drone("lost", None),
    )

    found = count_drones(Fleet({}, columns), NetworkId("a"), wall_now_ms=NOW_MS)
    nowhere = count_drones(Fleet({}, columns), NetworkId("nowhere"), wall_now_ms=NOW_MS)

    counts = {each.model_id: (each.registered, each.online, each.idle) for each in found.models}
    assert counts == {"dji-matrice-300-rtk": (1, 1, 1), "paper-scenario": (6, 5, 1)}
    assert (found.unplaced, nowhere.models) == (1, ())


def test_a_drone_in_the_air_is_counted_when_the_network_of_its_home_is_cached() -> None:
    networks = CachedNetworks()
    home = StationId("a-s1")
    columns = make_columns(networks, make_drone("in the air", None, home_station_id=home))
    before = count_drones(Fleet({}, columns), NetworkId("a"), wall_now_ms=NOW_MS)

    networks.put(make_network("a", "a-s1"))
    after = count_drones(Fleet({}, columns), NetworkId("a"), wall_now_ms=NOW_MS)

    assert (before.unplaced, before.models) == (1, ())
    assert [each.registered for each in after.models] == [1]
