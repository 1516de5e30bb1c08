"""Checks whether a delivery request is possible: its times, stations and masses.

Quotes and deliveries pass the same checks. A request that passes may still find no drone. The
registry says how heavy a package may be; its answer is cached for a moment. While the registry is
away, nobody checks masses and providers: booking finds out later, and rejects the delivery.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, NamedTuple

from skyway.announced_networks import CachedNetworks
from skyway.complaints import unknown_name
from skyway.contracts.candidate import PayloadLimit, PayloadLimitQuery, ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.delivery.qos import ProviderChoice
from skyway.delivery.request import DeliveryRequest, Package
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import StationId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.short_wait import ShortWait

#: The furthest end or opening of a window, the same as of a pickup (docs/reference/booking.md).
_FURTHEST: Final = timedelta(days=30)


class _Window(NamedTuple):
    """A window by the names of its fields; None without a limit."""

    first_field: str
    first_at: datetime | None
    last_field: str
    last_at: datetime | None
    takes_s: float


def check_windows(
    request: DeliveryRequest, *, now: datetime, loading_s: float = 0.0, dropoff_s: float = 0.0
) -> None:
    """Refuse windows that no fleet can meet.

    Parameters
    ----------
    loading_s, dropoff_s
        How long loading and a hand-over take in the network of the request; 0 if unknown.

    Raises
    ------
    InvalidInput
        A window is reversed, too short, has ended, lies more than 30 days ahead, opens after the
        deadline, ends before the pickup, or shares no moment with another window of the same
        destination.
    """
    pickup_at, deadline_at = request.earliest_pickup_at, request.qos.deadline_at
    for window in _windows(request, loading_s, dropoff_s):
        _check_alone(window, now=now)
        if (
            deadline_at is not None
            and window.first_at is not None
            and window.first_at > deadline_at
        ):
            detail = f"{utc_text(window.first_at)} is after the deadline {utc_text(deadline_at)}"
            raise InvalidInput(window.first_field, detail)
        if pickup_at is not None and window.last_at is not None and window.last_at < pickup_at:
            detail = f"{utc_text(window.last_at)} is before earliest_pickup_at"
            raise InvalidInput(window.last_field, f"{detail} {utc_text(pickup_at)}")
    _check_shared_destinations(request)


def _windows(request: DeliveryRequest, loading_s: float, dropoff_s: float) -> Iterator[_Window]:
    yield _Window(
        "earliest_pickup_at",
        request.earliest_pickup_at if request.latest_pickup_at is not None else None,
        "latest_pickup_at",
        request.latest_pickup_at,
        loading_s,
    )
    for number, package in enumerate(request.packages):
        prefix = f"packages.{number}"
        yield _Window(
            f"{prefix}.not_before_at",
            package.not_before_at,
            f"{prefix}.latest_at",
            package.latest_at,
            dropoff_s,
        )


def _check_alone(window: _Window, *, now: datetime) -> None:
    if window.last_at is not None and window.last_at <= now:
        detail = f"{utc_text(window.last_at)} is in the past: fleet time is {utc_text(now)}"
        raise InvalidInput(window.last_field, detail)
    for field, moment in (
        (window.first_field, window.first_at),
        (window.last_field, window.last_at),
    ):
        if moment is not None and moment > now + _FURTHEST:
            detail = f"{utc_text(moment)} is later than the limit of {utc_text(now + _FURTHEST)}"
            raise InvalidInput(field, f"{detail}, {_FURTHEST.days} days ahead")
    first_at, last_at = window.first_at, window.last_at
    if first_at is not None and last_at is not None and last_at < first_at:
        detail = f"{utc_text(last_at)} is before {window.first_field} {utc_text(first_at)}"
        raise InvalidInput(window.last_field, detail)
    if first_at is not None and last_at is not None:
        room_s = (last_at - first_at).total_seconds()
        if room_s < window.takes_s:
            detail = (
                f"{room_s:g} s after {window.first_field}, shorter than the {window.takes_s:g} s"
            )
            raise InvalidInput(window.last_field, f"{detail} that this takes in the network")


def _check_shared_destinations(request: DeliveryRequest) -> None:
    """Packages for one destination are handed over together."""
    for number, package in enumerate(request.packages):
        for other_number, other in enumerate(request.packages):
            if _are_apart(package, other):
                raise InvalidInput(
                    f"packages.{number}.latest_at",
                    f"{package.latest_at} is before packages.{other_number}.not_before_at "
                    f"{other.not_before_at}: both go to {package.destination.station_id!r} and are "
                    "handed over together; ask for them in two requests",
                )


def _are_apart(package: Package, other: Package) -> bool:
    return (
        package.destination == other.destination
        and package.latest_at is not None
        and other.not_before_at is not None
        and package.latest_at < other.not_before_at
    )


#: How long a limit is used without asking again, wall time. Fleets hardly change meanwhile, and
#: booking finds out whether a drone is available.
_KEPT: Final = timedelta(seconds=2)
#: The most limits that are cached: each choice of providers has its own.
_MOST_CACHED: Final = 1_000

#: The furthest moment that a request may name: this finds mistyped years.
_LONGEST_AHEAD: Final = timedelta(days=366)

#: The furthest pickup that a request may ask for (docs/reference/booking.md).
_FURTHEST_PICKUP: Final = timedelta(days=30)

#: A pickup that has passed by less is accepted, wall time: offers are compared for minutes.
_PAST_PICKUP: Final = timedelta(minutes=5)

#: A mass that exceeds the limit by less than this counts as equal, kilograms.
_MASS_TOLERANCE_KG: Final = 1e-9

#: Why a request has no offers when none of the providers that may serve it has a drone.
NO_PROVIDER: Final = ProviderReason(
    provider_id=None,
    code="NO_PROVIDER",
    detail="no provider serves it: none of the providers that may serve it has a drone",
    is_temporary=True,
)


class CachedPayloadLimits:
    """Payload limits from the registry; only a fresh limit refuses a package."""

    def __init__(self, registry: Registry, clock: FleetClock) -> None:
        self._registry = registry
        self._cached = AnswerCache(self._ask, clock=clock, kept=_KEPT, most=_MOST_CACHED)
        self._wait = ShortWait()

    async def limit_for(self, heaviest_kg: float, choice: ProviderChoice) -> PayloadLimit | None:
        """The payload limit of the chosen providers' drones, fresh if this mass might exceed it.

        None while the registry is away.
        """
        cached = self._cached.cached(choice)
        if cached is not None and _allows(cached, heaviest_kg):
            return cached
        return await self._wait.answer_of(self._cached.ask(choice))

    async def _ask(self, choice: ProviderChoice) -> PayloadLimit:
        return await self._registry.payload_limit(PayloadLimitQuery(providers=choice))


def _allows(limit: PayloadLimit, heaviest_kg: float) -> bool:
    if limit.unknown_provider_ids or limit.max_payload_kg is None:
        return False
    return heaviest_kg <= limit.max_payload_kg


@dataclass(frozen=True, slots=True)
class CheckedRequest:
    """A request that has passed all checks, and the position of its pickup.

    `reasons` say why no drone can be booked now, if the gateway knows already.
    """

    request: DeliveryRequest
    pickup_position: Position
    reasons: tuple[ProviderReason, ...]


@dataclass(frozen=True, slots=True)
class RequestChecks:
    """Checks requests against the clock, the network and the fleets."""

    payload_limits: CachedPayloadLimits
    networks: CachedNetworks
    composition: Composition
    clock: FleetClock
    composition_wait: ShortWait
    #: A further check; the sandbox refuses references that name no outcome.
    check_also: Callable[[DeliveryRequest], object]

    async def check(self, request: DeliveryRequest) -> CheckedRequest:
        """Check the whole request.

        Raises
        ------
        InvalidInput
            A field is impossible now: an unknown station, too heavy, a deadline in the past.
        RemoteProblem
            NO_NETWORK: no network is published at all.
        ServiceUnavailable
            Composition does not answer now, and never said whether the stations exist; or the
            network is closed to new requests.
        """
        self.check_also(request)
        self._check_times(request)
        _check_destinations(request)
        position = await self._check_stations(request)
        await self.composition.must_accept(request.pickup.station_id)
        loading_s, dropoff_s = self.networks.service_times_s(
            request.pickup.station_id, needs_proof=request.needs_proof
        )
        check_windows(request, now=self.clock.now(), loading_s=loading_s, dropoff_s=dropoff_s)
        has_provider = await self._check_payload(request)
        return CheckedRequest(request, position, () if has_provider else (NO_PROVIDER,))

    def _check_times(self, request: DeliveryRequest) -> None:
        now, deadline_at = self.clock.now(), request.qos.deadline_at
        if deadline_at is not None and deadline_at <= now:
            raise InvalidInput(
                "qos.deadline_at",
                f"{utc_text(deadline_at)} is in the past: fleet time is {utc_text(now)}",
            )
        pickup_at = request.earliest_pickup_at
        earliest = now - _PAST_PICKUP * self.clock.rate
        if request.latest_pickup_at is None and (pickup_at or now) < earliest:
            detail = f"{utc_text(pickup_at or now)} is in the past: fleet time is {utc_text(now)}"
            raise InvalidInput("earliest_pickup_at", detail)
        for field, moment, furthest in (
            ("qos.deadline_at", deadline_at, _LONGEST_AHEAD),
            ("earliest_pickup_at", pickup_at, _FURTHEST_PICKUP),
        ):
            if moment is not None and moment > now + furthest:
                detail = f"{utc_text(moment)} is later than the limit of {utc_text(now + furthest)}"
                raise InvalidInput(field, f"{detail}, {furthest.days} days ahead")
        if deadline_at is not None and (pickup_at or now) >= deadline_at:
            detail = f"must be before the deadline {utc_text(deadline_at)}"
            raise InvalidInput("earliest_pickup_at", detail)

    async def _check_stations(self, request: DeliveryRequest) -> Position:
        pickup, named = request.pickup.station_id, _stations_by_field(request)
        position = self.networks.position_if_connected(pickup, to=named.values())
        if position is not None:
            return position
        query = StationCheckQuery(
            station_ids=tuple(dict.fromkeys((pickup, *named.values()))), reachable_from=pickup
        )
        # The network may have changed since, but only composition could say so.
        last_position = self.networks.last_position_if_connected(pickup, to=named.values())
        if last_position is None:
            found = await self.composition.check_stations(query)
        else:
            asking = self.composition.check_stations(query)
            answer = await self.composition_wait.answer_of(asking)
            if answer is None:
                return last_position
            found = answer
        for field, station_id in {"pickup.station_id": pickup, **named}.items():
            if station_id in found.unknown:
                known = self.networks.station_ids()
                raise InvalidInput(field, unknown_name("station", station_id, known))
        for field, station_id in named.items():
            _check_station(field, station_id, found, pickup=pickup)
        return found.positions[pickup]

    async def _check_payload(self, request: DeliveryRequest) -> bool:
        """Check each package alone, as several trips may carry all; False without any provider.

        While the registry is away, nothing is checked: that is True.
        """
        choice = request.qos.providers
        heaviest_kg = max(package.mass_kg for package in request.packages)
        limit = await self.payload_limits.limit_for(heaviest_kg, choice)
        if limit is None:
            return True
        for provider_id in limit.unknown_provider_ids:
            field = f"qos.providers.{_field_of(provider_id, choice)}"
            raise InvalidInput(field, f"provider {provider_id!r} is unknown")
        if limit.max_payload_kg is None:
            return False
        what = f"the {limit.max_payload_kg:g} kg limit of drone model {limit.drone_model_id}"
        for number, package in enumerate(request.packages):
            if package.mass_kg > limit.max_payload_kg + _MASS_TOLERANCE_KG:
                detail = f"{package.mass_kg:g} kg exceeds {what}"
                raise InvalidInput(f"packages.{number}.mass_kg", detail)
        return True


def _check_destinations(request: DeliveryRequest) -> None:
    pickup = request.pickup.station_id
    for number, package in enumerate(request.packages):
        if package.destination.station_id == pickup:
            field = f"packages.{number}.destination.station_id"
            raise InvalidInput(field, f"{pickup!r} is the pickup: choose another station")


def _stations_by_field(request: DeliveryRequest) -> dict[str, StationId]:
    """The stations where packages may end, by the name of the request's field."""
    named: dict[str, StationId] = {}
    for number, package in enumerate(request.packages):
        named[f"packages.{number}.destination.station_id"] = package.destination.station_id
        if package.alternative is not None:
            named[f"packages.{number}.alternative.station_id"] = package.alternative.station_id
    return named


def _check_station(
    field: str, station_id: StationId, found: StationCheck, *, pickup: StationId
) -> None:
    networks = found.network_ids[pickup], found.network_ids[station_id]
    if networks[0] != networks[1]:
        detail = f"{station_id!r} lies in the network {networks[1]!r}, the pickup {pickup!r} in "
        raise InvalidInput(field, f"{detail}{networks[0]!r}: no delivery goes between networks")
    if station_id in found.unreachable:
        detail = f"no path of segments leads from {pickup!r} to {station_id!r}"
        raise InvalidInput(field, detail)


def _field_of(provider_id: str, choice: ProviderChoice) -> str:
    """The field of `qos.providers` that names a provider."""
    if choice.pinned == provider_id:
        return "pinned"
    for field in ("allowed", "denied"):
        named = getattr(choice, field) or ()
        with contextlib.suppress(ValueError):
            return f"{field}.{named.index(provider_id)}"
    return "allowed"
