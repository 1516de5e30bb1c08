"""Accepting a delivery request: checked against the world, then written once.

The row is the queue: once it is written, `book` finds it, whoever dies meanwhile.
"""

import contextlib
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.candidate import PayloadLimitQuery
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.station_check import StationCheckQuery
from skyway.delivery.request import DeliveryRequest, ProviderChoice
from skyway.errors import InvalidInput, SkywayError
from skyway.geo import Position
from skyway.ids import DeliveryId, StationId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.idempotency import Answer, once
from skyway.runtime.identity import Caller
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.tracing import current_traceparent
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.deliveries import store, told
from skyway_gateway.deliveries.delivery import Custodian, Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.patience import give_up_at
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.notifications.events import Events, Happening

#: Nobody plans further ahead; a year that is a typing mistake is found at once.
_LONGEST_AHEAD: Final = timedelta(days=366)

#: Masses are added up in binary: sums that differ by less are equal, kilograms.
_MASS_TOLERANCE_KG: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Accepts requests; `queued` is set when there is one to book."""

    db: Database
    registry: Registry
    composition: Composition
    events: Events
    clock: FleetClock
    mint: Mint
    queued: Wake

    async def accept(
        self,
        caller: Caller,
        request: DeliveryRequest,
        *,
        idempotency_key: str | None,
        body: bytes,
    ) -> Answer:
        """202 with the delivery, written together with its first event.

        Raises
        ------
        InvalidInput
            A field breaks a limit of the world: an unknown station, too heavy, too late.
        ServiceUnavailable
            The world cannot be asked now.
        """
        try:
            checked: Position | SkywayError = await self._check(request)
        except SkywayError as refusal:
            # Answered only after looking whether this very call was accepted before: a deadline
            # that has passed meanwhile, or a service that is away, must not change that answer.
            checked = refusal

        async def keep(tx: Tx) -> Answer:
            if isinstance(checked, SkywayError):
                raise checked
            delivery = await self._keep(tx, SubjectId(caller.subject_id), request, checked)
            location = {"Location": f"/v1/deliveries/{delivery.delivery_id}"}
            return Answer(202, delivery.model_dump_json().encode(), location)

        return await once(
            self.db,
            caller=str(caller),
            route="POST /v1/deliveries",
            key=idempotency_key,
            body=body,
            act=keep,
            clock=self.clock,
        )

    async def _keep(
        self, tx: Tx, customer_id: SubjectId, request: DeliveryRequest, position: Position
    ) -> Delivery:
        now = self.clock.now()
        delivery = _new_delivery(
            DeliveryId(self.mint("dlv")), customer_id=customer_id, request=request, at=now
        )
        queued = Queued(delivery, position, give_up_at(request, self.clock), current_traceparent())
        await store.add(tx, queued)
        await self.events.tell(
            tx,
            [Happening(DeliveryEventType.REQUESTED, now, told.requested(delivery))],
            delivery_id=delivery.delivery_id,
            customer_id=customer_id,
        )
        tx.after_commit(self.queued.set)
        return delivery

    async def _check(self, request: DeliveryRequest) -> Position:
        """Where the pickup is, once everything about the request is known to be possible."""
        self._check_times(request)
        position = await self._check_stations(request)
        await self._check_payload(request)
        return position

    def _check_times(self, request: DeliveryRequest) -> None:
        now, deadline_at = self.clock.now(), request.qos.deadline_at
        latest_at = now + _LONGEST_AHEAD
        if deadline_at is not None and deadline_at <= now:
            raise InvalidInput("qos.deadline_at", f"{deadline_at} is past: fleet time is {now}")
        for field, moment in (
            ("qos.deadline_at", deadline_at),
            ("earliest_pickup_at", request.earliest_pickup_at),
        ):
            if moment is not None and moment > latest_at:
                raise InvalidInput(field, f"{moment} is later than the limit of {latest_at}")
        if deadline_at is not None and (request.earliest_pickup_at or now) >= deadline_at:
            raise InvalidInput("earliest_pickup_at", f"must be before the deadline {deadline_at}")

    async def _check_stations(self, request: DeliveryRequest) -> Position:
        pickup = request.pickup.station_id
        query = StationCheckQuery(
            station_ids=tuple(dict.fromkeys((pickup, *request.destinations))),
            reachable_from=pickup,
        )
        found = await self.composition.check_stations(query)
        if pickup in found.unknown:
            raise InvalidInput("pickup.station_id", f"station {pickup!r} is unknown")
        for number, package in enumerate(request.packages):
            field = f"packages.{number}.destination.station_id"
            station_id = package.destination.station_id
            if station_id in found.unknown:
                raise InvalidInput(field, f"station {station_id!r} is unknown")
            if station_id in found.unreachable:
                raise InvalidInput(field, _no_path(pickup, station_id))
        return found.positions[pickup]

    async def _check_payload(self, request: DeliveryRequest) -> None:
        choice = request.qos.providers
        limit = await self.registry.payload_limit(PayloadLimitQuery(providers=choice))
        for provider_id in limit.unknown_provider_ids:
            field = f"qos.providers.{_place_of(provider_id, choice)}"
            raise InvalidInput(field, f"provider {provider_id!r} is unknown")
        if limit.max_payload_kg is None:
            return  # no fleet yet: the request waits for one
        allowed_kg = limit.max_payload_kg + _MASS_TOLERANCE_KG
        what = f"the {limit.max_payload_kg:g} kg limit of drone model {limit.drone_model_id}"
        for number, package in enumerate(request.packages):
            if package.mass_kg > allowed_kg:
                detail = f"{package.mass_kg:g} kg exceeds {what}"
                raise InvalidInput(f"packages.{number}.mass_kg", detail)
        if request.payload_kg > allowed_kg:
            detail = f"together {request.payload_kg:g} kg, which exceeds {what}"
            raise InvalidInput("packages", detail)


def _new_delivery(
    delivery_id: DeliveryId, *, customer_id: SubjectId, request: DeliveryRequest, at: datetime
) -> Delivery:
    pickup = Custodian(kind="STATION", id=request.pickup.station_id)
    return Delivery(
        delivery_id=delivery_id,
        customer_id=customer_id,
        state="REQUESTED",
        activity=None,
        flags=Flags(),
        reference=request.reference,
        request=request,
        created_at=at,
        updated_at=at,
        attempt=1,
        price=None,
        provider_id=None,
        missions=(),
        packages=tuple(
            PackageStatus(
                package_id=package.package_id,
                state="CREATED",
                destination=package.destination,
                mass_kg=package.mass_kg,
                custodian=pickup,
            )
            for package in request.packages
        ),
        refusals=(),
        reasons=(),
    )


def _no_path(pickup: StationId, destination: StationId) -> str:
    return f"no path of segments leads from {pickup!r} to {destination!r}"


def _place_of(provider_id: str, choice: ProviderChoice) -> str:
    """The field that names a provider."""
    if choice.pinned == provider_id:
        return "pinned"
    for field in ("allowed", "denied"):
        named = getattr(choice, field) or ()
        with contextlib.suppress(ValueError):
            return f"{field}.{named.index(provider_id)}"
    return "allowed"
