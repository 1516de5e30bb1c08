"""Which able drones are compared, and in which order: fairly over the providers."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import (
    MAX_CANDIDATES,
    MAX_CANDIDATES_PER_PROVIDER,
    CandidateQuery,
)
from skyway.geo import EARTH_RADIUS_M, unit_vector
from skyway_provider_registry.candidates.fleet_columns import Flags, FleetColumns, Rows

#: This many nearest drones include enough drones of most providers.
_WORTH_RANKING: Final = 4 * MAX_CANDIDATES


@dataclass(frozen=True, slots=True)
class Ranked:
    """Able drones in order: those that can be at the pickup first, then the fullest; ties by id.

    The time to the pickup counts from now, with the missions that the drone has before.

    They include every drone that can become a candidate.
    """

    rows: Rows
    provider: npt.NDArray[np.int32]
    #: Sorts the drones of a provider that would split the request: the strongest first.
    weakness_kg: npt.NDArray[np.float64]

    @classmethod
    def of(
        cls,
        query: CandidateQuery,
        columns: FleetColumns,
        able: Rows,
        split: Flags,
        *,
        now_ms: int,
    ) -> "Ranked":
        """The ranked rows of `able`, without drones that are too far to become candidates."""
        is_away = columns.column("station")[able] != columns.station(query.pickup_station_id)
        # The chord is a little shorter than the way along the ground, and is cheap to compute.
        x, y, z = unit_vector(query.pickup_position)
        chord = (
            (columns.column("x")[able] - x) ** 2
            + (columns.column("y")[able] - y) ** 2
            + (columns.column("z")[able] - z) ** 2
        )
        flight_s = EARTH_RADIUS_M * np.sqrt(chord) / columns.column("speed_mps")[able]
        wait_s = np.maximum(0, columns.column("free_ms")[able] - now_ms) / 1000
        arrival_s = np.where(is_away, flight_s, 0.0) + wait_s
        near = _near_enough(arrival_s, columns.column("provider")[able], split)
        able, arrival_s = able[near], arrival_s[near]
        emptiness = -columns.column("soc")[able]
        rows = able[np.lexsort((columns.order[able], emptiness, is_away[near], arrival_s))]
        provider = columns.column("provider")[rows]
        weakness_kg = np.where(split[provider], -columns.column("payload_kg")[rows], 0.0)
        return cls(rows, provider, weakness_kg)


def _near_enough(
    arrival_s: npt.NDArray[np.float64], provider: npt.NDArray[np.int32], split: Flags
) -> Flags:
    """Which drones are ranked: not those with enough nearer drones of the same provider.

    Ranking thousands of drones would take longer than everything else.
    """
    if len(arrival_s) <= _WORTH_RANKING:
        return np.ones(len(arrival_s), np.bool_)
    near: Flags = arrival_s <= np.partition(arrival_s, _WORTH_RANKING)[_WORTH_RANKING]
    is_short = np.bincount(provider[near], minlength=len(split)) < MAX_CANDIDATES_PER_PROVIDER
    is_needed: Flags = near | (is_short | split)[provider]
    return is_needed


def in_turn(ranked: Ranked, providers: int) -> Rows:
    """The candidates, nearest first; each provider's best comes before any provider's second."""
    if not len(ranked.rows):
        return ranked.rows
    # A stable sort: within a provider the rank stays, unless its strongest drones go first.
    by_provider = np.lexsort((ranked.weakness_kg, ranked.provider))
    provider = ranked.provider[by_provider]
    first = np.searchsorted(provider, np.arange(providers))
    turn = np.empty(len(provider), np.intp)
    turn[by_provider] = np.arange(len(provider)) - first[provider]
    chosen = np.argsort(turn, kind="stable")
    chosen = chosen[turn[chosen] < MAX_CANDIDATES_PER_PROVIDER][:MAX_CANDIDATES]
    rows: Rows = ranked.rows[np.sort(chosen)]
    return rows
