"""Where rehearsals are flown: five stations a few minutes apart, and a drone for them."""

import math
from collections import deque

from skyway_drone_agent.enrolment.enrolled_drone import BrokerLogin, EnrolledDrone

from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import EARTH_RADIUS_M, Position, distance_m
from skyway.ids import DroneId, DroneModelId, ProviderId, StationId

#: Metres east and north of home.
_METRES = {
    "home": (0.0, 0.0),
    "mill": (2000.0, 0.0),
    "shop": (4000.0, 300.0),
    "farm": (3500.0, 2300.0),
    "lake": (1000.0, 2400.0),
}

#: The segments, both ways; longer flights go over a station between.
_SEGMENTS = (
    ("home", "mill"),
    ("mill", "shop"),
    ("shop", "farm"),
    ("farm", "lake"),
    ("lake", "home"),
)

HOME = "home"

#: 20 m/s without load and 10 with 2 kg; a segment takes about a fifth of the battery.
MODEL = DroneModel(
    model_id=DroneModelId("rehearsed"),
    empty_mass_kg=4.0,
    max_payload_kg=2.0,
    battery_j=90_000.0,
    reserve_soc=0.1,
    speed_empty_mps=20.0,
    speed_full_mps=10.0,
    power_empty_w=100.0,
    stop_s=10.0,
    stop_j=500.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(600, 0.8), ChargePoint(1200, 1.0)),
)


def _position(east_m: float, north_m: float) -> Position:
    degree_m = math.radians(1.0) * EARTH_RADIUS_M
    return Position(
        -98.0 + east_m / (degree_m * math.cos(math.radians(30.0))), 30.0 + north_m / degree_m
    )


POSITIONS = {name: _position(*metres) for name, metres in _METRES.items()}

DRONE = EnrolledDrone(
    drone_id=DroneId("drn_1"),
    provider_id=ProviderId("prv_1"),
    model=MODEL,
    home_station_id=StationId(HOME),
    home_position=POSITIONS[HOME],
    soc=1.0,
    mqtt=BrokerLogin(user_name="drn_1", password="secret"),
)


def length_m(start: str, end: str) -> float:
    """The length of the straight flight."""
    return distance_m(POSITIONS[start], POSITIONS[end])


def route(start: str, end: str) -> list[str]:
    """The stations on the way with the fewest segments, without the first."""
    came_from = {start: start}
    waiting = deque([start])
    while end not in came_from:
        here = waiting.popleft()
        for one, other in (*_SEGMENTS, *((b, a) for a, b in _SEGMENTS)):
            if one == here and other not in came_from:
                came_from[other] = here
                waiting.append(other)
    way = [end]
    while came_from[way[0]] != way[0]:
        way.insert(0, came_from[way[0]])
    return way[1:]
