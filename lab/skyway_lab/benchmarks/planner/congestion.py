"""Other drones' reservations: each pad in turn free and held, for random times."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.cities import SEED, distances_m

from skyway.network.network import Network
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook

#: Mean length of a reservation, s; lengths are exponential. About a charge of the reference drone
#: by a third.
MEAN_HELD_S = 1_800.0

#: Networks of up to this size are reserved whole; larger ones around the sources.
WHOLE_UP_TO = 200_000
#: Metres from a source within which the pads of larger networks are reserved.
AROUND_M = 150_000.0

_PADS_AT_ONCE = 100_000


@dataclass(frozen=True, slots=True)
class Congestion:
    """The share of the time for which each pad is held, in [0, 1), and until when."""

    taken: float
    horizon_s: float


def book(network: Network, congestion: Congestion, *, sources: list[int]) -> PadBook:
    """The reservations of all pads, or on a large network of those around the sources."""
    if congestion.taken == 0:
        return NO_RESERVATIONS
    rows = _reserved_rows(network, sources)
    pads = network.columns.pads[rows]
    station = np.repeat(rows.astype(np.int32), pads)
    pad = (np.arange(station.size) - np.repeat(np.cumsum(pads) - pads, pads)).astype(np.int32)
    chance = np.random.default_rng([SEED, len(network.columns.station_ids)])
    parts = [
        _windows(
            station[first : first + _PADS_AT_ONCE],
            pad[first : first + _PADS_AT_ONCE],
            congestion,
            chance,
        )
        for first in range(0, station.size, _PADS_AT_ONCE)
    ]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    # Made in the book's own order: nothing is left to sort, which at a million stations counts.
    return PadBook(station=columns[0], pad=columns[1], start_ms=columns[2], end_ms=columns[3])


def _reserved_rows(network: Network, sources: list[int]) -> npt.NDArray[np.int64]:
    count = len(network.columns.station_ids)
    if count <= WHOLE_UP_TO:
        return np.arange(count)
    is_near = np.zeros(count, bool)
    for source in sources:
        is_near |= distances_m(network, source) <= AROUND_M
    return np.flatnonzero(is_near)


def _windows(
    station: npt.NDArray[np.int32],
    pad: npt.NDArray[np.int32],
    congestion: Congestion,
    chance: np.random.Generator,
) -> tuple[npt.NDArray[np.int64] | npt.NDArray[np.int32], ...]:
    """Reservations of these pads in the order of a pad book: station, pad, start, end."""
    mean_free_s = MEAN_HELD_S * (1 - congestion.taken) / congestion.taken
    expected = congestion.horizon_s / (MEAN_HELD_S + mean_free_s)
    # Six standard deviations more than expected: no pad runs out of reservations too early.
    most = math.ceil(expected + 6 * math.sqrt(2 * expected) + 6)
    free_s = chance.exponential(mean_free_s, (station.size, most))
    # Exponential times have no memory: a pad is held at time 0 with the same probability as later.
    free_s[:, 0] *= chance.random(station.size) >= congestion.taken
    held_s = chance.exponential(MEAN_HELD_S, (station.size, most))
    end_ms = np.rint(1000 * np.cumsum(free_s + held_s, axis=1)).astype(np.int64)
    start_ms = end_ms - np.maximum(np.rint(1000 * held_s).astype(np.int64), 1)
    start_ms[:, 1:] = np.maximum(start_ms[:, 1:], end_ms[:, :-1])
    counts = (start_ms < end_ms) & (start_ms < 1000 * congestion.horizon_s) & (end_ms > 0)
    each = counts.sum(axis=1)
    return np.repeat(station, each), np.repeat(pad, each), start_ms[counts], end_ms[counts]
