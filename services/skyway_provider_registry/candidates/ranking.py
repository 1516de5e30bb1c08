"""In which order able drones are compared, and which of them are: fairly over the providers."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import (
    MAX_CANDIDATES,
    MAX_CANDIDATES_PER_PROVIDER,
    CandidateQuery,
)
from skyway.geo import unit_vector
from skyway_provider_registry.candidates.fleet_columns import Flags, FleetColumns, Rows

#: So many of the nearest drones hold enough of most providers.
_WORTH_RANKING: Final = 4 * MAX_CANDIDATES


@dataclass(frozen=True, slots=True)
class Ranked:
    """Able drones, those at the pickup first, then the nearest, then the fullest; equals by id.

    All that can become candidates are among them.
    """

    rows: Rows
    provider: npt.NDArray[np.int32]
    #: Of providers that would split: the strongest first.
    weakness_kg: npt.NDArray[np.float64]

    @classmethod
    def of(cls, query: CandidateQuery, columns: FleetColumns, able: Rows, split: Flags) -> "Ranked":
        """The rows in `able`, without those that are not needed to rank them."""
        is_away = columns.column("station")[able] != columns.station(query.pickup_station_id)
        # The chord grows with the distance, and costs three products.
        x, y, z = unit_vector(query.pickup_position)
        chord = (
            (columns.column("x")[able] - x) ** 2
            + (columns.column("y")[able] - y) ** 2
            + (columns.column("z")[able] - z) ** 2
        )
        near = _near_enough(chord, is_away, columns.column("provider")[able], split)
        able, is_away, chord = able[near], is_away[near], chord[near]
        emptiness = -columns.column("soc")[able]
        rows = able[np.lexsort((columns.order[able], emptiness, chord, is_away))]
        provider = columns.column("provider")[rows]
        weakness_kg = np.where(split[provider], -columns.column("payload_kg")[rows], 0.0)
        return cls(rows, provider, weakness_kg)


def _near_enough(
    chord: npt.NDArray[np.float64], is_away: Flags, provider: npt.NDArray[np.int32], split: Flags
) -> Flags:
    """Which drones are ranked: not those that come after enough nearer ones of their provider.

    To rank thousands takes longer than all else.
    """
    if len(chord) <= _WORTH_RANKING:
        return np.ones(len(chord), np.bool_)
    near = ~is_away | (chord <= np.partition(chord, _WORTH_RANKING)[_WORTH_RANKING])
    is_short = np.bincount(provider[near], minlength=len(split)) < MAX_CANDIDATES_PER_PROVIDER
    is_needed: Flags = near | (is_short | split)[provider]
    return is_needed


def in_turn(ranked: Ranked, providers: int) -> Rows:
    """The candidates of all, nearest first: everybody's best comes in before anybody's second."""
    if not len(ranked.rows):
        return ranked.rows
    # Stable: within a provider the rank stays, unless its strongest go first.
    by_provider = np.lexsort((ranked.weakness_kg, ranked.provider))
    provider = ranked.provider[by_provider]
    first = np.searchsorted(provider, np.arange(providers))
    turn = np.empty(len(provider), np.intp)
    turn[by_provider] = np.arange(len(provider)) - first[provider]
    chosen = np.argsort(turn, kind="stable")
    chosen = chosen[turn[chosen] < MAX_CANDIDATES_PER_PROVIDER][:MAX_CANDIDATES]
    rows: Rows = ranked.rows[np.sort(chosen)]
    return rows
