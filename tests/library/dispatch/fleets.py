"""Small fleets for tests: a made-up city with one pad a station, and requests drawn by a seed."""

from collections.abc import Sequence
from random import Random
from typing import Any

from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.problem import FleetDrone, FleetProblem, FleetRequest
from skyway.drone.model import ChargePoint, DroneModel
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city

#: A drone that flies about 13 km on a full battery, so that most trips need a pad.
MODEL = DroneModel(
    model_id="short-range",
    empty_mass_kg=5.0,
    max_payload_kg=2.0,
    battery_j=400_000.0,
    reserve_soc=0.1,
    speed_empty_mps=15.0,
    speed_full_mps=14.0,
    power_empty_w=400.0,
    stop_s=5.0,
    stop_j=2_000.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(2000, 0.8), ChargePoint(3600, 1)),
)


def city(seed: int, *, stations: int = 8) -> Network:
    """A city whose stations have one pad each."""
    return synthetic_city(stations=stations, seed=seed, pads=1, degree=4.0, spacing_m=2_500.0)


def small_fleet(seed: int, *, drones: int = 2, requests: int = 5, **fields: Any) -> FleetProblem:
    """A fleet of two providers; some requests may be pooled, and some have a promise."""
    random = Random(seed)
    network = city(seed)
    stations = list(network.stations)
    hub = random.choice(stations)
    return FleetProblem.model_validate(
        {
            "network": network,
            "drones": [
                FleetDrone(
                    drone_id=f"d{number}",
                    provider_id=f"provider-{number % 2}",
                    model=MODEL,
                    station_id=random.choice(stations),
                    free_s=float(random.randrange(0, 900)),
                    soc=random.uniform(0.2, 1.0),
                )
                for number in range(drones)
            ],
            "requests": [
                _request(random, number, hub=hub, stations=stations) for number in range(requests)
            ],
            "loading_s": 60.0,
            "dropoff_s": 30.0,
            "hand_over_s": 30.0,
            "pad_gap_s": 60.0,
            **fields,
        }
    )


def with_pickups(problem: FleetProblem, seed: int) -> FleetProblem:
    """The fleet whose customers may hand their packages over at some other stations, if pooled."""
    random = Random(seed)

    def others(request: FleetRequest) -> tuple[str, ...]:
        taken = {request.source, *(each.destination for each in request.packages)}
        free = [each for each in problem.network.stations if each not in taken]
        return tuple(random.sample(free, random.randint(0, 3))) if request.pooling else ()

    requests = [each.model_copy(update={"pickups": others(each)}) for each in problem.requests]
    return problem.model_copy(update={"requests": tuple(requests)})


def without_promises(problem: FleetProblem) -> FleetProblem:
    """The fleet in which no customer was promised anything."""
    requests = [each.model_copy(update={"promised_s": None}) for each in problem.requests]
    return problem.model_copy(update={"requests": tuple(requests)})


def _request(random: Random, number: int, *, hub: str, stations: Sequence[str]) -> FleetRequest:
    source = hub if random.random() < 0.6 else random.choice(stations)
    return FleetRequest.model_validate(
        {
            "request_id": f"r{number}",
            "source": source,
            "packages": [
                {
                    "package_id": f"p{number}-{one}",
                    "mass_kg": random.uniform(0.1, 0.7),
                    "destination": random.choice(stations),
                }
                for one in range(random.randint(1, 2))
            ],
            "known_s": -float(random.randrange(0, 600)),
            "promised_s": random.choice([None, float(random.randrange(1_000, 9_000))]),
            "deadline_s": random.choice([None, float(random.randrange(1_000, 9_000))]),
            "pooling": random.random() < 0.7,
            "weight": random.choice([1.0, 1.0, 3.0]),
        }
    )


def delivered(plan: FleetPlan) -> dict[str, float]:
    """When the last package of each request is delivered."""
    return {one.request_id: one.delivered_s for each in plan.trips for one in each.requests}
