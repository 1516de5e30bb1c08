"""Seeded instances: a made-up city, a source, destinations and packages, and pads that are taken.

All chance comes from seeds, so the same seed makes the same instance on every machine.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Literal

import numpy as np
import numpy.typing as npt

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_MATRICE_300
from skyway.ids import DroneModelId, PackageId, StationId
from skyway.network.bundled import texas_corridor
from skyway.network.network import DEFAULT_PADS, Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import DroneAtStart, PackageToDeliver, PadReservation, Problem
from skyway.units import hours_to_s, minutes_to_s


def chance(seed: int | str) -> Random:
    """A source of chance that repeats: the same for the same seed on every machine."""
    return Random(seed)


def seed_of(*parts: object) -> int:
    """A seed made of these parts; equal parts make equal seeds."""
    return chance("/".join(map(str, parts))).getrandbits(48)


#: Other drones charge between 20 and 60 minutes (the paper's authors' work on pad assignment).
SHORTEST_SESSION_S = minutes_to_s(20)
LONGEST_SESSION_S = minutes_to_s(60)

Rows = npt.NDArray[np.int64]

#: Pads are free for good after two days; no plan of the experiments should take so long.
HORIZON_S = hours_to_s(48)


def taken_book(
    network: Network, rows: Rows, *, share: float, seed: int, horizon_s: float
) -> PadBook:
    """Reservations like those of `taken_pads`, as arrays and for the stations in these rows.

    For networks of many stations.
    """
    random = np.random.default_rng(seed)
    pads = network.columns.pads[rows]
    station, first = np.repeat(rows, pads), np.repeat(np.cumsum(pads) - pads, pads)
    mean_free_s = (SHORTEST_SESSION_S + LONGEST_SESSION_S) / 2 * (1 - share) / share
    sessions = math.ceil(horizon_s / (SHORTEST_SESSION_S + mean_free_s))
    size = (len(station), sessions)
    held_ms = np.rint(1000 * random.uniform(SHORTEST_SESSION_S, LONGEST_SESSION_S, size))
    free_ms = np.rint(1000 * random.exponential(mean_free_s, size))
    free_ms[:, 0] -= 1000 * np.rint(random.uniform(0, LONGEST_SESSION_S, len(station)))
    end_ms = np.cumsum(held_ms + free_ms, axis=1)
    is_ahead = end_ms > 0
    return PadBook.of_arrays(
        station=np.repeat(station, sessions).reshape(size)[is_ahead].astype(np.int32),
        pad=np.repeat(np.arange(len(station)) - first, sessions).reshape(size)[is_ahead],
        start_ms=(end_ms - held_ms)[is_ahead].astype(np.int64),
        end_ms=end_ms[is_ahead].astype(np.int64),
    )


def taken_pads(
    network: Network, *, share: float, seed: int, horizon_s: float = HORIZON_S
) -> tuple[PadReservation, ...]:
    """Reservations that take this share of every pad's time until the horizon.

    Sessions last 20 to 60 minutes, evenly; the free times between them are exponential.

    Parameters
    ----------
    share
        From 0 (all pads free) to below 1.
    """
    if share <= 0:
        return ()
    random = chance(f"{seed}/pads")
    mean_free_s = (SHORTEST_SESSION_S + LONGEST_SESSION_S) / 2 * (1 - share) / share
    reservations = []
    for station_id in network.stations:
        for pad in range(network.stations[station_id].pads):
            # The first session began before time 0, so that the share holds from the start.
            now_s = -random.uniform(0, LONGEST_SESSION_S + mean_free_s)
            while now_s < horizon_s:
                end_s = now_s + random.uniform(SHORTEST_SESSION_S, LONGEST_SESSION_S)
                if end_s > 0:
                    reservations.append(
                        PadReservation(
                            station_id=station_id,
                            pad=pad,
                            start_s=math.floor(now_s),
                            end_s=math.ceil(end_s),
                        )
                    )
                now_s = math.ceil(end_s) + random.expovariate(1 / mean_free_s)
    return tuple(reservations)


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
#: With fewer packages than this, each weighs no more than with this many. Our own choice.
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
