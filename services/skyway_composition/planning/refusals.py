"""Why providers make no offer: collected candidate by candidate, told provider by provider."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any

from skyway.contracts.candidate import Candidate, ProviderReason, ProviderReasonCode
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, ProviderId, StationId
from skyway_composition.planning.limits import Limits
from skyway_composition.planning.offer import Offer
from skyway_composition.planning.round_trip import NoTrip
from skyway_composition.planning.world import World


class Refusals:
    """Collects why candidates make no offer."""

    def __init__(self) -> None:
        self._reasons: list[ProviderReason] = []

    def add(
        self,
        candidate: Candidate,
        code: ProviderReasonCode,
        detail: str,
        *,
        is_temporary: bool,
        **data: Any,  # numbers behind the code
    ) -> None:
        """Keep why a candidate makes no offer."""
        self._reasons.append(
            ProviderReason(
                provider_id=candidate.provider_id,
                code=code,
                detail=detail,
                is_temporary=is_temporary,
                data=data,
            )
        )

    def add_no_trip(self, candidate: Candidate, reason: NoTrip) -> None:
        """Keep why there is no trip for a candidate."""
        self.add(
            candidate,
            reason.code,
            reason.detail,
            is_temporary=reason.is_temporary,
            **dict(reason.data),
        )

    def is_affordable(self, offer: Offer, limits: Limits) -> bool:
        """Whether an offer keeps the price limit; if not, that is the reason."""
        price, limit = offer.price, limits.max_price
        if limit is None or price.amount <= limit:
            return True
        self.add(
            offer.parts[0].candidate,
            "TOO_EXPENSIVE",
            f"price {price.amount} exceeds the limit of {limit} {price.currency}",
            is_temporary=False,
            price=price.amount,
            max_price=limit,
        )
        return False

    def of_providers(self, with_offer: Collection[ProviderId]) -> tuple[ProviderReason, ...]:
        """One reason per provider without offer; what may pass tells more than what stays."""
        told: dict[ProviderId | None, ProviderReason] = {}
        for reason in self._reasons:
            known = told.get(reason.provider_id)
            if known is None or (reason.is_temporary and not known.is_temporary):
                told[reason.provider_id] = reason
        return tuple(reason for provider, reason in told.items() if provider not in with_offer)


def refused_for_all(
    candidates: Iterable[Candidate], code: ProviderReasonCode, detail: str
) -> Iterator[ProviderReason]:
    """The same lasting reason for every provider that has a candidate."""
    for provider_id in dict.fromkeys(each.provider_id for each in candidates):
        yield ProviderReason(provider_id=provider_id, code=code, detail=detail, is_temporary=False)


def fit_candidates(
    refusals: Refusals,
    world: World,
    request: DeliveryRequest,
    *,
    candidates: Sequence[Candidate],
    busy: frozenset[DroneId],
    at_ms: int,
) -> list[Candidate]:
    """The candidates worth composing for; why the others are not is kept."""
    known = world.skyway.network.row_of
    places: list[StationId] = [request.pickup.station_id, *request.destinations]
    missing = [place for place in places if place not in known]
    fit: list[Candidate] = []
    for candidate in candidates:
        reason = (
            _away(world, candidate, missing)
            or _stopped(world, candidate, request.pickup.station_id, at_ms=at_ms)
            or _unfit(world, candidate, busy)
        )
        if reason is None:
            fit.append(candidate)
        else:
            refusals.add_no_trip(candidate, reason)
    return fit


def _away(world: World, candidate: Candidate, missing: Sequence[StationId]) -> NoTrip | None:
    away = [*missing]
    if candidate.station_id not in world.skyway.network.row_of:
        away.append(candidate.station_id)
    if not away:
        return None
    detail = f"station {away[0]!r} is not in network {world.skyway.network_id!r}"
    return NoTrip("DESTINATION_UNREACHABLE", detail, is_temporary=False)


def _stopped(world: World, candidate: Candidate, pickup: StationId, *, at_ms: int) -> NoTrip | None:
    """Why it may not take off where it stands, or with its load."""
    stop = world.conditions.stops(candidate, at_ms=at_ms, station_ids=(pickup,))
    return None if stop is None else NoTrip("GROUND_STOP", stop, is_temporary=True)


def _unfit(world: World, candidate: Candidate, busy: frozenset[DroneId]) -> NoTrip | None:
    if candidate.drone_id in busy:
        return NoTrip("BUSY", "its drones are on missions", is_temporary=True)
    reserve_soc, currency = candidate.model.reserve_soc, world.skyway.settings.currency
    if candidate.soc < reserve_soc:
        detail = f"charge {candidate.soc:.3f} is below the reserve"
        data = (("soc", candidate.soc), ("reserve_soc", reserve_soc))
        return NoTrip("LOW_CHARGE", detail, is_temporary=True, data=data)
    if candidate.tariff.currency != currency:
        detail = (
            f"its tariff is in {candidate.tariff.currency}, prices in this network are in "
            f"{currency}"
        )
        return NoTrip("OTHER_CURRENCY", detail, is_temporary=False)
    return None
