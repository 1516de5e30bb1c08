"""Why a provider has no candidate: of all that stands in its drones' way, the most telling."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from skyway.contracts.candidate import (
    CandidateQuery,
    Loading,
    ProviderReason,
    ProviderReasonCode,
)
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway_provider_registry.fleets.states import DroneStateName

#: Grams lost in adding up masses must not make a package too heavy, relative to the limit.
_MASS_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class KnownProvider:
    """What selection looks at of a provider."""

    provider_id: ProviderId
    tariff: Tariff
    is_active: bool
    loading: Loading = "AUTOMATIC"


@dataclass(frozen=True, slots=True)
class KnownDrone:
    """What selection looks at of a drone; without `station_id` it is not standing at one."""

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    state: DroneStateName
    station_id: StationId | None
    position: Position
    soc: float
    is_busy: bool


@dataclass(frozen=True, slots=True)
class _Obstacle:
    """A reason for a whole fleet; it `is_temporary` when it ends by itself."""

    code: ProviderReasonCode
    detail: str
    is_temporary: bool


#: From the first to the last to be told: one drone that will be free again is worth asking later.
_OBSTACLES: Final = (
    _Obstacle("BUSY", "all drones that could fly this are busy", is_temporary=True),
    _Obstacle("LOW_CHARGE", "the free drones are charged below their reserve", is_temporary=True),
    _Obstacle("OFFLINE", "the drones are offline or in maintenance", is_temporary=True),
    _Obstacle("REFUSED", "the drones have refused this delivery", is_temporary=False),
)


def obstacle_of(query: CandidateQuery, drone: KnownDrone) -> ProviderReasonCode | None:
    """What keeps this drone from being a candidate; None when nothing does."""
    if query.payload_kg > drone.model.max_payload_kg * (1 + _MASS_TOLERANCE):
        return "OVERWEIGHT"
    if drone.drone_id in query.excluded_drone_ids:
        return "REFUSED"
    if drone.state in ("REGISTERED", "OFFLINE", "MAINTENANCE"):
        return "OFFLINE"
    if drone.is_busy or drone.station_id is None:
        return "BUSY"
    if drone.soc < drone.model.reserve_soc:
        return "LOW_CHARGE"
    return None


def exclusion_of(query: CandidateQuery, provider: KnownProvider) -> ProviderReason | None:
    """Why this provider's fleet is not even looked at; None when it is."""
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
    query: CandidateQuery, provider_id: ProviderId, *, fleet: Sequence[KnownDrone]
) -> ProviderReason:
    """Why an admitted provider has no candidate in its fleet."""
    if not fleet:
        return ProviderReason(
            provider_id=provider_id,
            code="NO_DRONES",
            detail="the provider has no drones",
            is_temporary=False,
        )
    found = {obstacle_of(query, drone) for drone in fleet}
    for obstacle in _OBSTACLES:
        if obstacle.code in found:
            return ProviderReason(
                provider_id=provider_id,
                code=obstacle.code,
                detail=obstacle.detail,
                is_temporary=obstacle.is_temporary,
            )
    strongest = max((drone.model for drone in fleet), key=lambda model: model.max_payload_kg)
    return ProviderReason(
        provider_id=provider_id,
        code="OVERWEIGHT",
        detail=(
            f"payload {query.payload_kg:g} kg exceeds the {strongest.max_payload_kg:g} kg limit "
            f"of drone model {strongest.model_id}"
        ),
        is_temporary=False,
        data={"mass_kg": query.payload_kg, "limit_kg": strongest.max_payload_kg},
    )


def not_compared(provider_id: ProviderId) -> ProviderReason:
    """Why a provider with able drones has no candidate: others stood nearer."""
    return ProviderReason(
        provider_id=provider_id,
        code="NOT_COMPARED",
        detail="drones of other providers stand nearer, and only so many are compared at a time",
        is_temporary=True,
    )
