"""Accepting a delivery request: checked against the world, then written once.

The row is the queue: once it is written, `book` finds it, whoever dies meanwhile.
"""

from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.delivery.request import DeliveryRequest
from skyway.errors import SkywayError
from skyway.geo import Position
from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.idempotency import Answer, once
from skyway.runtime.identity import Caller
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.tracing import current_traceparent
from skyway_gateway.deliveries import store, told
from skyway_gateway.deliveries.delivery import Custodian, Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.patience import give_up_at
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.notifications.events import Events, Happening
from skyway_gateway.quotes.checks import Checks


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Accepts requests; `queued` is set when there is one to book."""

    db: Database
    checks: Checks
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
            checked: Position | SkywayError = await self.checks.check(request)
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
