"""A fleet without a registry: drones with their broker accounts, each at a station of its own."""

import random
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter
from skyway_drone_agent.enrolment.enrolled_drone import BrokerLogin, EnrolledDrone

from skyway.contracts.broker_rules import drone_account
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId

#: Everybody's password on a broker of our own.
PASSWORD: Final = "secret"

_PROVIDER: Final = ProviderId("prv_bench")

#: Degrees around San Marcos, Texas, within which homes lie: about 50 km each way.
_SOUTH_WEST: Final = (-98.4, 29.4)
_SPAN_DEG: Final = 0.9

_DRONES: Final = TypeAdapter(tuple[EnrolledDrone, ...])


def crew_of(count: int, *, seed: int) -> tuple[EnrolledDrone, ...]:
    """So many drones, scattered by seed, as their registration would answer them."""
    chance = random.Random(seed)
    return tuple(_drone(number, _somewhere(chance)) for number in range(count))


def accounts_of(drones: Iterable[EnrolledDrone]) -> list[str]:
    """The user names of these drones at the broker."""
    return [drone.user_name for drone in drones]


def write_fleet(file: Path, drones: Sequence[EnrolledDrone]) -> Path:
    """Write the file that an agent is started with."""
    file.write_bytes(_DRONES.dump_json(tuple(drones)))
    return file


def read_drones(answers: Sequence[dict[str, Any]]) -> tuple[EnrolledDrone, ...]:
    """Drones as the registry has answered them; Any, for they are JSON."""
    return _DRONES.validate_python(answers)


def _somewhere(chance: random.Random) -> Position:
    west, south = _SOUTH_WEST
    return Position(west + chance.random() * _SPAN_DEG, south + chance.random() * _SPAN_DEG)


def _drone(number: int, home: Position) -> EnrolledDrone:
    drone_id = DroneId(f"drn_{number:05}")
    return EnrolledDrone(
        drone_id=drone_id,
        provider_id=_PROVIDER,
        model=DJI_MATRICE_300_RTK,
        home_station_id=StationId(f"home-{number:05}"),
        home_position=home,
        soc=1.0,
        mqtt=BrokerLogin(user_name=drone_account(_PROVIDER, drone_id), password=PASSWORD),
    )
