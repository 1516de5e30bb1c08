"""Why providers make no offer: reasons are collected per candidate and shown per provider."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from skyway.contracts.candidate import (
    FREE_AT,
    Candidate,
    Possible,
    ProviderReason,
    ProviderReasonCode,
)
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, ProviderId, StationId
from skyway.scheduling.trip import NoTrip
from skyway.units import CHARGE_TOLERANCE, ms_to_moment
from skyway_composition.planning.offer import Limits, Offer
from skyway_composition.planning.world import World


class Refusals:
    """Collects why candidates make no offer."""

    def __init__(self) -> None:
        self._reasons: list[ProviderReason] = []

    def add(
        self,
        provider_id: ProviderId,
        code: ProviderReasonCode,
        detail: str,
        *,
        is_temporary: bool,
        possible: Sequence[Possible] = (),
        **data: Any,  # numbers behind the code
    ) -> None:
        """Add the reason why a candidate of this provider makes no offer."""
        self._reasons.append(
            ProviderReason(
                provider_id=provider_id,
                code=code,
                detail=detail,
                is_temporary=is_temporary,
                data=data,
                possible=tuple(possible),
            )
        )

    def add_no_trip(self, provider_id: ProviderId, reason: NoTrip) -> None:
        """Add the reason why a candidate of this provider has no trip."""
        data: dict[str, Any] = dict(reason.data)
        self.add(provider_id, reason.code, reason.detail, is_temporary=reason.is_temporary, **data)

    def without_plan(self, shortlist: Shortlist) -> Shortlist:
        """The candidates of providers none of whose plans was only too expensive."""
        dear = {each.provider_id for each in self._reasons if each.code == "TOO_EXPENSIVE"}
        return shortlist.only(
            [row for row, of in enumerate(shortlist.provider_ids) if of not in dear]
        )

    def is_affordable(self, offer: Offer, limits: Limits) -> bool:
        """Whether an offer keeps the price limit; if not, the reason is added."""
        price, limit = offer.price, limits.max_price
        if limit is None or price.amount <= limit:
            return True
        self.add(
            offer.provider_id,
            "TOO_EXPENSIVE",
            f"price {price.amount} exceeds max_price {limit}, both in minor units of "
            f"{price.currency} such as cents",
            is_temporary=False,
            price=price.amount,
            max_price=limit,
        )
        return False

    def of_providers(self, with_offer: Collection[ProviderId]) -> tuple[ProviderReason, ...]:
        """One reason per provider without an offer; a temporary reason is preferred.

        Of busy drones the one that is free first counts.
        """
        chosen: dict[ProviderId | None, ProviderReason] = {}
        for reason in self._reasons:
            earlier = chosen.get(reason.provider_id)
            if earlier is None or _says_more(reason, earlier):
                chosen[reason.provider_id] = reason
        return tuple(reason for provider, reason in chosen.items() if provider not in with_offer)


def _says_more(reason: ProviderReason, earlier: ProviderReason) -> bool:
    if reason.is_temporary != earlier.is_temporary:
        return reason.is_temporary
    if reason.code != "BUSY" or earlier.code != "BUSY" or FREE_AT not in reason.data:
        return False
    return FREE_AT not in earlier.data or reason.data[FREE_AT] < earlier.data[FREE_AT]


def refused_for_all(
    provider_ids: Iterable[ProviderId], code: ProviderReasonCode, detail: str
) -> Iterator[ProviderReason]:
    """The same permanent reason for each of these providers."""
    for provider_id in dict.fromkeys(provider_ids):
        yield ProviderReason(provider_id=provider_id, code=code, detail=detail, is_temporary=False)


def fit_among(
    refusals: Refusals,
    world: World,
    request: DeliveryRequest,
    *,
    shortlist: Shortlist,
    busy: Mapping[DroneId, int | None],
    at_ms: int,
) -> Shortlist:
    """The candidates worth composing for; the reasons of the others are added to `refusals`."""
    row_of = world.skyway.network.row_of
    places: list[StationId] = [request.pickup.station_id, *request.destinations]
    missing = [place for place in places if place not in row_of]
    is_plain = not missing and not world.conditions.has_ground_stops
    fit: list[int] = []
    for row, may_be_unfit in enumerate(_may_be_unfit(world, shortlist, busy)):
        if is_plain and not may_be_unfit:
            fit.append(row)
            continue
        candidate = shortlist.candidate(row)
        reason = (
            _missing_station(world, candidate, missing)
            or _ground_stop(world, candidate, request.pickup.station_id, at_ms=at_ms)
            or _unfit_drone(world, candidate, busy)
        )
        if reason is None:
            fit.append(row)
        else:
            refusals.add_no_trip(candidate.provider_id, reason)
    return shortlist.only(fit)


def _may_be_unfit(world: World, shortlist: Shortlist, busy: Collection[DroneId]) -> Iterator[bool]:
    """For each candidate, whether it may be unfit for a reason other than places or ground stops.

    A quick test, because nearly all candidates are fit.
    """
    row_of, currency = world.skyway.network.row_of, world.skyway.settings.currency
    reserves = {key: model.reserve_soc for key, model in shortlist.model_of.items()}
    foreign = {key for key, of in shortlist.terms_of.items() if of.tariff.currency != currency}
    for drone_id, provider_id, model_id, soc, station_id in zip(
        shortlist.drone_ids,
        shortlist.provider_ids,
        shortlist.model_ids,
        shortlist.socs,
        shortlist.station_ids,
        strict=True,
    ):
        yield (
            drone_id in busy
            or provider_id in foreign
            or soc < reserves[model_id]
            or station_id not in row_of
        )


def _missing_station(
    world: World, candidate: Candidate, missing: Sequence[StationId]
) -> NoTrip | None:
    away = [*missing]
    if candidate.station_id not in world.skyway.network.row_of:
        away.append(candidate.station_id)
    if not away:
        return None
    detail = f"station {away[0]!r} is not in network {world.skyway.network_id!r}"
    return NoTrip("DESTINATION_UNREACHABLE", detail, is_temporary=False)


def _ground_stop(
    world: World, candidate: Candidate, pickup: StationId, *, at_ms: int
) -> NoTrip | None:
    """The ground stop that forbids a take-off from the drone's station or from the pickup."""
    stop = world.conditions.ground_stop(candidate, at_ms=at_ms, station_ids=(pickup,))
    return None if stop is None else NoTrip("GROUND_STOP", stop, is_temporary=True)


def _unfit_drone(
    world: World, candidate: Candidate, busy: Mapping[DroneId, int | None]
) -> NoTrip | None:
    if candidate.drone_id in busy:
        return _busy(busy[candidate.drone_id])
    reserve_soc, currency = candidate.model.reserve_soc, world.skyway.settings.currency
    if candidate.soc < reserve_soc - CHARGE_TOLERANCE:
        detail = f"charge {candidate.soc:.3f} is below the reserve of {reserve_soc:.3f}"
        data = (("soc", candidate.soc), ("reserve_soc", reserve_soc))
        return NoTrip("LOW_CHARGE", detail, is_temporary=True, data=data)
    if candidate.tariff.currency != currency:
        detail = (
            f"its tariff is in {candidate.tariff.currency}, prices in this network are in "
            f"{currency}"
        )
        return NoTrip("OTHER_CURRENCY", detail, is_temporary=False)
    return None


def _busy(free_ms: int | None) -> NoTrip:
    """A drone is on missions, until a moment beyond the horizon if that is known."""
    if free_ms is None:
        return NoTrip(
            "BUSY", "its drones are on missions, or held for other offers", is_temporary=True
        )
    free_at = f"{ms_to_moment(free_ms):%Y-%m-%dT%H:%M:%SZ}"
    detail = f"its drones have missions until {free_at}, further ahead than missions are booked"
    return NoTrip("BUSY", detail, is_temporary=True, data=((FREE_AT, free_at),))
