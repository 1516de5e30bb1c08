"""Where an idle drone waits for its next request: near the pickups that are expected.

The drone goes where it shortens the expected flight to the next pickup most, given where other
drones wait already. The nearest drone may be busy, and then the next one flies, as for ambulances
(Daskin 1983). The drone goes there only if this is worth the energy: the flights to pickups must
save at least what the longer way there needs. Until each of the waiting drones has flown, as many
pickups come as drones wait, so the saving of one pickup counts that many times.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from skyway.geo import EARTH_RADIUS_M
from skyway.ids import StationId
from skyway.network.columns import Floats
from skyway.network.great_circle import unit_vectors
from skyway.network.network import Network
from skyway.units import hours_to_s

#: A request that is so old counts half as much as a new one, milliseconds: 7 days. Our own choice.
_HALF_LIFE_MS: Final = hours_to_s(7 * 24) * 1000

_HOUR_MS: Final = hours_to_s(1) * 1000

#: Requests at another hour of the day count less: at this many hours from it only `_LEAST_WEIGHT`.
#: Our own choice.
_FAR_HOURS: Final = 4.0

_LEAST_WEIGHT: Final = 0.1

#: From fewer requests nothing is expected. Our own choice.
_FEWEST_REQUESTS: Final = 10

#: At most this many pickups count, the most frequent ones. So the work does not grow with the
#: network. Our own choice.
_MOST_PICKUPS: Final = 200

#: After so many places no further pickup adds places. Our own choice.
_MOST_PLACES: Final = 500

#: At most this many places are worth trying. Our own choice.
_MOST_CHOSEN: Final = 3

#: The share of the time in which a drone is busy, or has too little charge. Our own choice.
_BUSY: Final = 0.75

#: Only so many drones count for a pickup, the nearest ones. All of them are busy 1 % of the time.
_MOST_NEAR: Final = 16

#: Ways that differ by less differ by rounding only, metres.
_ROUNDING_M: Final = 1e-3


class PastRequest(NamedTuple):
    """A request that was booked: its pickup station, and its moment in milliseconds."""

    station_id: StationId
    at_ms: int


def expected_pickups(past: Iterable[PastRequest], *, at_ms: int) -> dict[StationId, float]:
    """By station: the chance that the next pickup is there; empty if too little is known.

    Recent requests count most, and those at the same hour of the day.
    """
    weights: dict[StationId, float] = defaultdict(float)
    requests = 0
    for each in past:
        weights[each.station_id] += _weight(at_ms - each.at_ms)
        requests += 1
    most = _most(weights)[:_MOST_PICKUPS]
    total = sum(weight for _, weight in most)
    if requests < _FEWEST_REQUESTS or total == 0.0:  # requests of long ago weigh nothing
        return {}
    return {station_id: weight / total for station_id, weight in most}


def _most(weights: Mapping[StationId, float]) -> list[tuple[StationId, float]]:
    """Stations and weights, the largest weight first."""
    return sorted(weights.items(), key=lambda each: (-each[1], each[0]))


def _weight(ago_ms: float) -> float:
    hours = abs(ago_ms) / _HOUR_MS % 24
    apart = min(hours, 24 - hours)
    of_hour = max(_LEAST_WEIGHT, 1 - apart / _FAR_HOURS)
    decay: float = 0.5 ** (abs(ago_ms) / _HALF_LIFE_MS)
    return of_hour * decay


def places_to_wait(
    network: Network,
    pickups: Mapping[StationId, float],
    *,
    waiting: Mapping[StationId, int],
    start: StationId,
    otherwise: StationId,
) -> tuple[StationId, ...]:
    """The stations at which a drone should rather wait than at `otherwise`, the best first.

    All drones fly alike, so their times and energy follow from lengths, and great circles stand
    for ways. A station is left out if as many drones wait there as it has pads.

    Parameters
    ----------
    network
        The network as the drone sees it: without pads that do not fit it.
    pickups
        The chance of the next pickup at each station, as in `expected_pickups`.
    waiting
        How many other drones wait at each station.
    start
        Where the drone's standby begins.
    otherwise
        Where the drone waits unless another station is better.
    """
    row_of = network.row_of
    chances = {row_of[each]: chance for each, chance in _most(pickups) if each in row_of}
    places = [row_of[otherwise], *_places(network, chances, waiting)]
    if not chances or len(places) == 1:
        return ()
    ends = [*chances]
    others = [
        row for row in map(row_of.get, sorted(Counter(waiting).elements())) if row is not None
    ]
    others_m, places_m = (_lengths_m(network, rows, ends) for rows in (others, places))
    approach_m = _approaches_m(others_m, places_m) @ np.array([*chances.values()])
    way_m = _lengths_m(network, places, [row_of[start]])[:, 0]
    better = _better(approach_m, way_m, drones=1 + sum(waiting.values()))
    ids = network.columns.station_ids
    lengths_m = np.round(approach_m, 3).tolist(), np.round(way_m, 3).tolist()
    keys = [*zip(*lengths_m, (ids[each] for each in places), strict=True)]
    order = sorted(better, key=keys.__getitem__)
    return tuple(ids[places[each]] for each in order[:_MOST_CHOSEN])


def _approaches_m(others_m: Floats, places_m: Floats) -> Floats:
    """The expected way to each pickup if one more drone waits at each place, metres.

    The ways of the other drones are ``(others, pickups)``, all else is ``(places, pickups)``. The
    drone at rank k flies if it is free and all nearer drones are busy.
    """
    near_m = np.sort(others_m, axis=0)[:_MOST_NEAR]
    count, pickups = near_m.shape
    flies = ((1 - _BUSY) * _BUSY ** np.arange(count + 1))[:, None]
    flies[_MOST_NEAR:] = 0.0
    none = np.zeros((1, pickups))
    nearer_m = np.concatenate([none, np.cumsum(flies[:-1] * near_m, axis=0)])
    farther_m = np.concatenate([np.cumsum((flies[1:] * near_m)[::-1], axis=0)[::-1], none])
    rank = (near_m[None] < places_m[:, None]).sum(axis=1)
    pickup = np.arange(pickups)
    ways_m: Floats = nearer_m[rank, pickup] + flies[rank, 0] * places_m + farther_m[rank, pickup]
    return ways_m


def _better(approach_m: Floats, way_m: Floats, *, drones: int) -> list[int]:
    """The places that save as much on the approaches as the way there is longer, or more.

    The first place is the one to which all others are compared.
    """
    saved_m = approach_m[0] - approach_m
    is_better = (saved_m > _ROUNDING_M) & (drones * saved_m >= way_m - way_m[0])
    better: list[int] = np.flatnonzero(is_better).tolist()
    return better


def _places(
    network: Network, pickups: Iterable[int], waiting: Mapping[StationId, int]
) -> list[int]:
    """The rows of the pickups and of their neighbours where a drone can wait, in their order."""
    columns, near = network.columns, network.outgoing
    found: dict[int, None] = {}
    for pickup in pickups:
        for row in (pickup, *near.station[near.at(pickup)].tolist()):
            if columns.pads[row] > waiting.get(columns.station_ids[row], 0):
                found[row] = None
                if len(found) == _MOST_PLACES:
                    return [*found]
    return [*found]


def _lengths_m(network: Network, starts: Sequence[int], ends: Sequence[int]) -> Floats:
    """The great circles between the stations in these rows, ``(starts, ends)``, metres."""
    first, second = (_directions(network, rows) for rows in (starts, ends))
    apart = np.linalg.norm(first[:, None] - second[None], axis=2)
    lengths_m: Floats = 2 * EARTH_RADIUS_M * np.arcsin(np.minimum(1.0, apart / 2))
    return lengths_m


def _directions(network: Network, rows: Sequence[int]) -> Floats:
    columns = network.columns
    return unit_vectors(columns.longitude_deg[[*rows]], columns.latitude_deg[[*rows]])
