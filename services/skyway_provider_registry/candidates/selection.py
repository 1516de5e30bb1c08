"""Which drones could fly a request: the nearest able ones, fairly over the providers."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import (
    MAX_CANDIDATES,
    MAX_CANDIDATES_PER_PROVIDER,
    CandidateQuery,
    CargoPackage,
    PayloadLimit,
    ProviderReason,
    ProviderReasonCode,
)
from skyway.contracts.shortlist import Candidates, Shortlist, learned_column
from skyway.delivery.qos import ProviderChoice
from skyway.drone.cargo import misfit
from skyway.drone.model import DroneModel
from skyway.geo import EARTH_RADIUS_M, unit_vector
from skyway.ids import ProviderId
from skyway_provider_registry.candidates.fleet_view import Flags, Fleet, FleetColumns, Rows
from skyway_provider_registry.candidates.reasons import (
    CachedDrone,
    CachedProvider,
    exclusion_of,
    heaviest_kg,
    not_compared,
    reason_of,
)

#: Rounding errors of summed masses must not make a package too heavy; relative to the limit.
_MASS_TOLERANCE: Final = 1e-9

#: The obstacles of a drone; the first that holds counts, and 0 stands for none.
_OBSTACLES: Final[tuple[ProviderReasonCode, ...]] = (
    "OVERWEIGHT",
    # Before the temporary obstacles: a drone that is free again is still in its own network.
    "DESTINATION_UNREACHABLE",
    "REFUSED",
    "OFFLINE",
    "BUSY",
    "LOW_CHARGE",
)

#: Stands for a row that does not exist.
_NONE: Final = -1

#: The places of the temporary obstacles, counted from 1.
_PASSING: Final = [1 + _OBSTACLES.index(code) for code in ("BUSY", "LOW_CHARGE")]

#: This many nearest drones include enough drones of most providers.
_WORTH_RANKING: Final = 4 * MAX_CANDIDATES


async def select_each(
    queries: Sequence[CandidateQuery], fleet: Fleet, *, wall_now_ms: int, now_ms: int
) -> tuple[Candidates, ...]:
    """The choice of each query; other work goes on between two of them, but the fleet stays."""
    found: list[Candidates] = []
    for query in queries:
        found.append(select(query, fleet, wall_now_ms=wall_now_ms, now_ms=now_ms))
        await asyncio.sleep(0)
    return tuple(found)


def select(query: CandidateQuery, fleet: Fleet, *, wall_now_ms: int, now_ms: int) -> Candidates:
    """The drones to compare, nearest first, and a reason for each provider that has none."""
    columns = fleet.columns
    reasons = {
        provider.provider_id: excluded
        for provider in fleet.providers.values()
        if (excluded := exclusion_of(query, provider)) is not None
    }
    admitted = np.zeros(len(columns.providers), np.bool_)
    for provider_id, index in columns.providers.items():
        admitted[index] = provider_id in fleet.providers and provider_id not in reasons
    elsewhere = columns.elsewhere(query.pickup_station_id)
    lifting = _lifting(query, columns, elsewhere)
    obstacles = _obstacles(query, columns, lifting.drones, elsewhere, wall_now_ms=wall_now_ms)
    able = np.flatnonzero((obstacles == 0) & admitted[columns.column("provider")])
    ranked = _Ranked.of(query, columns, able, lifting.split, now_ms=now_ms)
    chosen = _in_turn(ranked, len(columns.providers)).tolist()
    kept = [row for row in columns.rows_of(query.kept_drone_ids) if row in able]
    candidates = [columns.drones[row] for row in dict.fromkeys((*chosen, *kept))]
    compared = {drone.provider_id for drone in candidates}
    found = _found_by_provider(columns, obstacles)
    passing: Flags = np.any(found[:, _PASSING] != _NONE, axis=1)
    for provider_id in fleet.providers.keys() - reasons.keys() - compared:
        place = columns.providers.get(provider_id)
        if place is not None and found[place, 0] != _NONE:
            reasons[provider_id] = not_compared(provider_id)
        else:
            reasons[provider_id] = _reason(query, columns, found, provider_id)
    # Not validated again: all parts were validated before, and validation costs as much as this.
    return Candidates.model_construct(
        shortlist=_shortlist(candidates, fleet.providers),
        infeasible=tuple(sorted(reasons.values(), key=lambda reason: reason.provider_id or "")),
        more_later=tuple(each for each in sorted(compared) if passing[columns.providers[each]]),
    )


@dataclass(frozen=True, slots=True)
class _Lifting:
    """Which drones are strong enough, and which providers would split the request."""

    drones: Flags
    split: Flags


def _lifting(query: CandidateQuery, columns: FleetColumns, elsewhere: Flags) -> _Lifting:
    """Which drones are strong enough.

    When no drone of a provider carries everything, its drones that lift the heaviest package count;
    if some package needs more than lift, its drones that carry any package.
    Drones that stand `elsewhere` do not decide whether a provider would split.
    """
    provider = columns.column("provider")
    limit_kg = columns.column("payload_kg") * (1 + _MASS_TOLERANCE)
    lifts_all = limit_kg >= query.payload_kg
    lifts_one = limit_kg >= heaviest_kg(query)
    if query.packages:
        lifts_all &= columns.with_models(lambda model: misfit(model, query.packages) is None)
        lifts_one = columns.with_models(lambda model: _carries_one(model, query.packages))
    split = np.ones(len(columns.providers), np.bool_)
    split[provider[lifts_all & ~elsewhere]] = False
    return _Lifting(lifts_all | (split[provider] & lifts_one), split)


def _carries_one(model: DroneModel, packages: Sequence[CargoPackage]) -> bool:
    return any(
        each.mass_kg <= model.max_payload_kg and misfit(model, [each]) is None for each in packages
    )


def _obstacles(
    query: CandidateQuery,
    columns: FleetColumns,
    lifts: Flags,
    elsewhere: Flags,
    *,
    wall_now_ms: int,
) -> npt.NDArray[np.intp]:
    """By row: 0, or the place in `_OBSTACLES`, counted from 1, of the drone's first obstacle."""
    has_refused = np.zeros(len(lifts), np.bool_)
    has_refused[columns.rows_of(query.excluded_drone_ids)] = True
    in_the_way = (
        ~lifts,
        elsewhere,
        has_refused,
        columns.column("online_until_ms") < wall_now_ms,
        columns.column("is_busy"),
        columns.column("is_low"),
    )
    first = np.zeros(len(lifts), np.intp)
    for code in range(len(in_the_way), 0, -1):
        first[in_the_way[code - 1]] = code
    return first


def _found_by_provider(columns: FleetColumns, obstacles: npt.NDArray[np.intp]) -> Rows:
    """``(providers, 1 + obstacles)``: the row of one drone of each provider with each obstacle."""
    found = np.full((len(columns.providers), 1 + len(_OBSTACLES)), _NONE, np.intp)
    found[columns.column("provider"), obstacles] = np.arange(len(obstacles))
    return found


def _reason(
    query: CandidateQuery, columns: FleetColumns, found: Rows, provider_id: ProviderId
) -> ProviderReason:
    index = columns.providers.get(provider_id)
    rows = () if index is None else found[index, 1:].tolist()
    examples = {
        code: columns.drones[row]
        for code, row in zip(_OBSTACLES, rows, strict=False)
        if row != _NONE
    }
    return reason_of(
        query,
        provider_id,
        found=examples,
        network_id=columns.networks.network_of(query.pickup_station_id),
        strongest=columns.strongest.get(provider_id),
    )


def _shortlist(
    drones: Sequence[CachedDrone], providers: Mapping[ProviderId, CachedProvider]
) -> Shortlist:
    return Shortlist.model_construct(
        models=tuple({each.model.model_id: each.model for each in drones}.values()),
        providers=tuple(
            providers[provider_id].terms
            for provider_id in dict.fromkeys(each.provider_id for each in drones)
        ),
        drone_ids=tuple(each.drone_id for each in drones),
        provider_ids=tuple(each.provider_id for each in drones),
        model_ids=tuple(each.model.model_id for each in drones),
        socs=tuple(each.soc for each in drones),
        station_ids=tuple(each.station_id for each in drones if each.station_id is not None),
        home_station_ids=tuple(each.home_station_id for each in drones),
        standbys=tuple(each.standby or providers[each.provider_id].standby for each in drones),
        learned=learned_column(each.learned for each in drones),
    )


def payload_limit(fleet: Fleet, choice: ProviderChoice) -> PayloadLimit:
    """The strongest model of all admitted providers' drones, busy or not; ties by id."""
    named = (*filter(None, [choice.pinned]), *(choice.allowed or ()), *(choice.denied or ()))
    models = (
        model
        for provider_id, model in fleet.columns.strongest.items()
        if (provider := fleet.providers.get(provider_id)) is not None
        and provider.is_active
        and choice.admits(provider_id)
    )
    strongest = min(models, key=lambda one: (-one.max_payload_kg, one.model_id), default=None)
    return PayloadLimit(
        max_payload_kg=strongest.max_payload_kg if strongest else None,
        drone_model_id=strongest.model_id if strongest else None,
        unknown_provider_ids=tuple(
            provider_id
            for provider_id in dict.fromkeys(named)
            if provider_id not in fleet.providers
        ),
    )


@dataclass(frozen=True, slots=True)
class _Ranked:
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
    ) -> "_Ranked":
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


def _in_turn(ranked: _Ranked, providers: int) -> Rows:
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
