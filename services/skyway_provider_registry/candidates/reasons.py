"""Why a provider has no candidate: the most useful of the obstacles of its drones."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from skyway.contracts.candidate import (
    CandidateQuery,
    Loading,
    ProviderReason,
    ProviderReasonCode,
    Standby,
)
from skyway.contracts.shortlist import ProviderTerms
from skyway.delivery.offer import Tariff
from skyway.drone.cargo import misfit
from skyway.drone.learned_values import AS_MODELLED, LearnedValues
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, NetworkId, ProviderId, StationId


@dataclass(frozen=True)
class CachedProvider:
    """A provider as selection sees it."""

    provider_id: ProviderId
    tariff: Tariff
    is_active: bool
    loading: Loading = "AUTOMATIC"
    standby: Standby = "HOME"

    @cached_property
    def terms(self) -> ProviderTerms:
        """The part of an answer that all candidates of this provider share."""
        return ProviderTerms(provider_id=self.provider_id, tariff=self.tariff, loading=self.loading)


@dataclass(frozen=True, slots=True)
class CachedDrone:
    """A drone as selection sees it; `station_id` is None when it stands at no station.

    A drone that has missions stands where it is free after them, from `free_ms` of fleet time on.
    It counts as online until `online_until_ms` of wall time; each message moves that moment.
    Without a `standby` of its own it has its provider's.
    """

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    online_until_ms: int
    station_id: StationId | None
    position: Position
    soc: float
    is_busy: bool
    standby: Standby | None = None
    free_ms: int = 0
    learned: LearnedValues = AS_MODELLED


@dataclass(frozen=True, slots=True)
class _Obstacle:
    """A reason that holds for a whole fleet; it `is_temporary` when it ends by itself."""

    code: ProviderReasonCode
    detail: str
    is_temporary: bool


#: The first that holds is reported: a drone that will be free again is worth asking for later.
_OBSTACLES: Final = (
    _Obstacle("BUSY", "all drones that could fly this are busy", is_temporary=True),
    _Obstacle("LOW_CHARGE", "the free drones are charged below their reserve", is_temporary=True),
    _Obstacle("OFFLINE", "the drones are offline, in maintenance or due for it", is_temporary=True),
    _Obstacle("REFUSED", "the drones have refused this delivery", is_temporary=False),
)


def heaviest_kg(query: CandidateQuery) -> float:
    """The least mass that a drone must lift: all, or one package when the request may be split."""
    return query.heaviest_kg or query.payload_kg


def exclusion_of(query: CandidateQuery, provider: CachedProvider) -> ProviderReason | None:
    """Why this provider is left out completely; None when it is admitted."""
    if not query.providers.admits(provider.provider_id):
        detail = "the request does not admit this provider"
    elif not provider.is_active:
        detail = "the provider is suspended"
    else:
        return None
    return ProviderReason(
        provider_id=provider.provider_id, code="NOT_ADMITTED", detail=detail, is_temporary=False
    )


def reason_of(
    query: CandidateQuery,
    provider_id: ProviderId,
    *,
    found: Mapping[ProviderReasonCode, CachedDrone],
    network_id: NetworkId | None,
    strongest: DroneModel | None,
) -> ProviderReason:
    """Why an admitted provider has no candidate.

    `found` has one drone of the provider for each obstacle; `network_id` is the pickup's, or None.
    """
    if strongest is None:
        return ProviderReason(
            provider_id=provider_id,
            code="NO_DRONES",
            detail="the provider has no drones",
            is_temporary=False,
        )
    for obstacle in _OBSTACLES:
        if obstacle.code in found:
            return ProviderReason(
                provider_id=provider_id,
                code=obstacle.code,
                detail=obstacle.detail,
                is_temporary=obstacle.is_temporary,
            )
    if (drone := found.get("DESTINATION_UNREACHABLE")) is not None:
        return _unreachable(drone, network_id)
    return _not_carried(query, provider_id, strongest)


def _unreachable(drone: CachedDrone, network_id: NetworkId | None) -> ProviderReason:
    """In the same words as composition, which answers for networks that are not cached here."""
    return ProviderReason(
        provider_id=drone.provider_id,
        code="DESTINATION_UNREACHABLE",
        detail=f"station {drone.station_id!r} is not in network {network_id!r}",
        is_temporary=False,
    )


def _not_carried(
    query: CandidateQuery, provider_id: ProviderId, strongest: DroneModel
) -> ProviderReason:
    mass_kg = heaviest_kg(query)
    found = misfit(strongest, query.packages)
    if found is not None and mass_kg <= strongest.max_payload_kg:
        return ProviderReason(
            provider_id=provider_id, code=found.code, detail=found.detail, is_temporary=False
        )
    return ProviderReason(
        provider_id=provider_id,
        code="OVERWEIGHT",
        detail=(
            f"payload {mass_kg:g} kg exceeds the {strongest.max_payload_kg:g} kg limit "
            f"of drone model {strongest.model_id}"
        ),
        is_temporary=False,
        data={"mass_kg": mass_kg, "limit_kg": strongest.max_payload_kg},
    )


def not_compared(provider_id: ProviderId) -> ProviderReason:
    """Why a provider with able drones has no candidate: other drones stand nearer."""
    return ProviderReason(
        provider_id=provider_id,
        code="NOT_COMPARED",
        detail="drones of other providers stand nearer, and only so many are compared at a time",
        is_temporary=True,
    )
