"""Large fleets have the same candidates as ranking each drone by itself would give."""

import random
from collections import defaultdict

import pytest
from skyway_provider_registry.candidates.fleet_view import Fleet, FleetColumns
from skyway_provider_registry.candidates.reasons import CachedDrone, CachedProvider
from skyway_provider_registry.candidates.selection import select

from skyway.announced_networks import CachedNetworks
from skyway.contracts.candidate import (
    MAX_CANDIDATES,
    MAX_CANDIDATES_PER_PROVIDER,
    CandidateQuery,
)
from skyway.delivery.offer import Tariff
from skyway.delivery.qos import ProviderChoice
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_SCENARIO
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId

PICKUP = Position(-97.94, 29.88)
STRONG = PAPER_SCENARIO
#: The stronger of them stand farther away.
WEAK = (DJI_MATRICE_300_RTK, DJI_MATRICE_300_RTK.model_copy(update={"max_payload_kg": 2.5}))
#: More than the weak models lift, whose provider would split it.
QUERY = CandidateQuery(
    pickup_station_id=StationId("pickup"),
    pickup_position=PICKUP,
    payload_kg=5.0,
    heaviest_kg=2.0,
    providers=ProviderChoice(),
)


def make_fleet(chance: random.Random) -> list[CachedDrone]:
    """Large fleets near by, one far away, a small one, and one of which none lifts everything."""
    fleets = {"big": 300, "bigger": 400, "far": 100, "small": 3, "split": 60}
    return [
        make_drone(chance, f"{provider}-{number}", provider)
        for provider, size in fleets.items()
        for number in range(size)
    ]


def make_drone(chance: random.Random, name: str, provider: str) -> CachedDrone:
    away = chance.randrange(40) / 100 + (5.0 if provider == "far" else 0.0)
    return CachedDrone(
        drone_id=DroneId(name),
        provider_id=ProviderId(provider),
        model=WEAK[away < 0.35] if provider == "split" else STRONG,
        home_station_id=StationId("home"),
        online_until_ms=0,
        # At the pickup by its own word, wherever it is.
        station_id=StationId(chance.choice(["pickup", *["elsewhere"] * 50])),
        position=Position(PICKUP.longitude_deg + away, PICKUP.latitude_deg),
        soc=chance.choice([0.5, 0.7, 0.9]),
        is_busy=chance.random() < 0.2,
    )


def ranked_one_by_one(drones: list[CachedDrone]) -> list[DroneId]:
    """The candidates as docs/reference/booking.md describes them."""

    def rank(drone: CachedDrone) -> tuple[object, ...]:
        away = drone.position.longitude_deg - PICKUP.longitude_deg
        is_away = drone.station_id != "pickup"
        arrival = away / drone.model.speed_empty_mps if is_away else 0.0
        return (arrival, is_away, -drone.soc, drone.drone_id)

    able = sorted((drone for drone in drones if not drone.is_busy), key=rank)
    fleets: dict[ProviderId, list[int]] = defaultdict(list)
    for place, drone in enumerate(able):
        fleets[drone.provider_id].append(place)
    # Other providers have drones of one strength, so their order does not change.
    turns = [
        turn
        for places in fleets.values()
        for turn in enumerate(sorted(places, key=lambda place: -able[place].model.max_payload_kg))
    ]
    first = sorted(turn for turn in turns if turn[0] < MAX_CANDIDATES_PER_PROVIDER)
    return [able[place].drone_id for place in sorted(place for _, place in first[:MAX_CANDIDATES])]


@pytest.mark.parametrize("seed", range(20))
def test_large_fleets_have_the_same_candidates_as_ranking_every_drone(seed: int) -> None:
    drones = make_fleet(random.Random(seed))
    columns = FleetColumns(CachedNetworks())
    columns.put(drones)
    providers = {drone.provider_id for drone in drones}
    cached = {name: CachedProvider(name, Tariff(), is_active=True) for name in providers}

    found = select(QUERY, Fleet(cached, columns), wall_now_ms=0, now_ms=0)

    assert list(found.shortlist.drone_ids) == ranked_one_by_one(drones)
