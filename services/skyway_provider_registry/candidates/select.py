"""Who could fly a request: the nearest able drones, fairly over the providers."""

from collections.abc import Iterable, Sequence
from itertools import chain, zip_longest

from skyway.contracts.candidate import (
    MAX_CANDIDATES,
    MAX_CANDIDATES_PER_PROVIDER,
    Candidate,
    CandidateQuery,
    Candidates,
    ProviderReason,
)
from skyway.geo import distance_m
from skyway.ids import ProviderId
from skyway_provider_registry.candidates.reasons import (
    KnownDrone,
    KnownProvider,
    exclusion_of,
    not_compared,
    obstacle_of,
    reason_of,
)


def select(
    query: CandidateQuery, *, providers: Iterable[KnownProvider], drones: Iterable[KnownDrone]
) -> Candidates:
    """The drones to compare, nearest first, and a reason for each provider that has none."""
    known = {provider.provider_id: provider for provider in providers}
    fleets: dict[ProviderId, list[KnownDrone]] = {provider_id: [] for provider_id in known}
    for drone in drones:
        fleets[drone.provider_id].append(drone)
    reasons: list[ProviderReason] = []
    able: list[list[KnownDrone]] = []
    for provider in known.values():
        fleet = fleets[provider.provider_id]
        if (excluded := exclusion_of(query, provider)) is not None:
            reasons.append(excluded)
        elif best := _best(query, fleet):
            able.append(best)
        else:
            reasons.append(reason_of(query, provider.provider_id, fleet=fleet))
    chosen = _in_turn(query, able)
    compared = {drone.provider_id for drone in chosen}
    left_out = {fleet[0].provider_id for fleet in able} - compared
    reasons.extend(not_compared(provider_id) for provider_id in left_out)
    return Candidates(
        candidates=tuple(_candidate(drone, known[drone.provider_id]) for drone in chosen),
        infeasible=tuple(sorted(reasons, key=lambda reason: reason.provider_id)),
    )


def _best(query: CandidateQuery, fleet: Sequence[KnownDrone]) -> list[KnownDrone]:
    """The able drones of one provider, the best first, no more than it may send."""
    able = (drone for drone in fleet if obstacle_of(query, drone) is None)
    return sorted(able, key=lambda drone: _rank(query, drone))[:MAX_CANDIDATES_PER_PROVIDER]


def _in_turn(query: CandidateQuery, fleets: Sequence[Sequence[KnownDrone]]) -> list[KnownDrone]:
    """The candidates of all, nearest first: everybody's best comes in before anybody's second."""
    rounds = zip_longest(*fleets)
    ordered = (
        sorted((drone for drone in turn if drone is not None), key=lambda d: _rank(query, d))
        for turn in rounds
    )
    chosen = list(chain.from_iterable(ordered))[:MAX_CANDIDATES]
    return sorted(chosen, key=lambda drone: _rank(query, drone))


def _rank(query: CandidateQuery, drone: KnownDrone) -> tuple[bool, float, float, str]:
    """Sorts at the pickup first, then the nearest, then the fullest; equals by id."""
    return (
        drone.station_id != query.pickup_station_id,
        distance_m(drone.position, query.pickup_position),
        -drone.soc,
        drone.drone_id,
    )


def _candidate(drone: KnownDrone, provider: KnownProvider) -> Candidate:
    if drone.station_id is None:
        raise ValueError(f"{drone.drone_id} is not standing anywhere")
    return Candidate(
        provider_id=drone.provider_id,
        drone_id=drone.drone_id,
        model=drone.model,
        soc=drone.soc,
        station_id=drone.station_id,
        home_station_id=drone.home_station_id,
        tariff=provider.tariff,
        loading=provider.loading,
    )
