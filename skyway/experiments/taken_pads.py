"""Pads that other drones hold at random times: congestion by chance."""

import math

import numpy as np
import numpy.typing as npt

from skyway.experiments.chance import chance
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import PadReservation
from skyway.units import hours_to_s, minutes_to_s

#: Other drones charge between 20 and 60 minutes (the paper's authors' work on pad assignment).
SHORTEST_SESSION_S = minutes_to_s(20)
LONGEST_SESSION_S = minutes_to_s(60)

Rows = npt.NDArray[np.int64]

#: Pads are free for good after two days; no plan of the experiments should take so long.
HORIZON_S = hours_to_s(48)


def taken_book(
    network: Network, rows: Rows, *, share: float, seed: int, horizon_s: float
) -> PadBook:
    """The same as arrays, of the stations in these rows: for networks of many stations."""
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
