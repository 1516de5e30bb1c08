"""Seeded instances: a made-up city, a source, destinations and packages, and pads taken."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Literal

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_MATRICE_300
from skyway.experiments.chance import chance
from skyway.experiments.taken_pads import taken_pads
from skyway.ids import DroneModelId, PackageId, StationId
from skyway.network.bundled import texas_corridor
from skyway.network.network import DEFAULT_PADS, Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem

#: The maker's drone with one of its two batteries (its mass as with both): 34 km empty, 20 km
#: with all it can carry, so that trips across a city have to recharge.
SHORT_RANGE = DJI_MATRICE_300_RTK.model_copy(
    update={
        "model_id": DroneModelId("dji-matrice-300-one-battery"),
        "battery_j": DJI_MATRICE_300_RTK.battery_j / 2,
    }
)

#: A package weighs from this share to the whole of an equal share of the payload. Our own choice.
_LIGHTEST_SHARE = 0.2
#: Fewer packages than this weigh no more than if there were as many. Our own choice.
_PACKAGES_AT_FULL_LOAD = 4


@dataclass(frozen=True, slots=True)
class Setting:
    """What an instance is drawn from; the defaults are our reading of the paper's evaluation.

    The paper says: 10 to 35 stations, 4 pads, its drone, random source and destinations. It leaves
    open how many segments leave a station, how far apart stations lie, and how many packages there
    are. `taken` is the share of the pads' time that other drones hold, 0 to 1; no package is
    heavier than `heaviest_kg` or than its share of the payload.
    """

    stations: int = 30
    degree: float = 2.5
    spacing_m: float = 5_000.0
    packages: int = 2
    pads: int = DEFAULT_PADS
    taken: float = 0.0
    model: DroneModel = PAPER_MATRICE_300
    recharge_policy: Literal["partial", "full"] = "full"
    heaviest_kg: float = math.inf


def city_problem(setting: Setting, *, seed: int) -> Problem:
    """The instance of this setting that this seed draws."""
    network = synthetic_city(
        stations=setting.stations,
        seed=seed,
        pads=setting.pads,
        degree=setting.degree,
        spacing_m=setting.spacing_m,
    )
    random = chance(f"{seed}/request")
    source, *destinations = random.sample(list(network.stations), setting.packages + 1)
    return Problem(
        network=network,
        drone=DroneAtStart(model=setting.model, soc=setting.model.top_soc),
        source=source,
        packages=packages_for(destinations, setting, random=random),
        pad_reservations=taken_pads(network, share=setting.taken, seed=seed),
        recharge_policy=setting.recharge_policy,
    )


def texas_problem(setting: Setting, *, seed: int) -> Problem:
    """A request between random places of the Texas corridor; the setting's city is not read."""
    network, places = _texas()
    random = chance(f"{seed}/request")
    source, *destinations = random.sample(places, setting.packages + 1)
    return Problem(
        network=network,
        drone=DroneAtStart(model=setting.model, soc=setting.model.top_soc),
        source=source,
        packages=packages_for(destinations, setting, random=random),
        pad_reservations=taken_pads(network, share=setting.taken, seed=seed),
        recharge_policy=setting.recharge_policy,
    )


@cache
def _texas() -> tuple[Network, list[StationId]]:
    """The corridor, and its places that San Marcos can reach."""
    # Its segments avoid the airports' discs already, so the zones would only cost time.
    network = Network.from_columns(texas_corridor().columns)
    return network, connected_to(network, StationId("san-marcos"))


def packages_for(
    destinations: Sequence[StationId], setting: Setting, *, random: Random
) -> tuple[PackageToDeliver, ...]:
    """A package of random mass for each destination; together they are never too heavy."""
    share_kg = setting.model.max_payload_kg / max(len(destinations), _PACKAGES_AT_FULL_LOAD)
    most_kg = min(setting.heaviest_kg, share_kg)
    return tuple(
        PackageToDeliver(
            package_id=PackageId(f"p{number}"),
            mass_kg=round(most_kg * random.uniform(_LIGHTEST_SHARE, 1.0), 3),
            destination=destination,
        )
        for number, destination in enumerate(destinations, start=1)
    )


def connected_to(network: Network, start: StationId) -> list[StationId]:
    """The stations that can be flown to from this one, in the order of the network."""
    reached, frontier = {start}, [start]
    while frontier:
        for segment in network.segments_from(frontier.pop()):
            if segment.to_id not in reached:
                reached.add(segment.to_id)
                frontier.append(segment.to_id)
    return [station_id for station_id in network.stations if station_id in reached]
