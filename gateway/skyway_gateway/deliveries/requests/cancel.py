"""Cancels a delivery, or some of its packages, as far as they can still be stopped.

A delivery that waits for its first booking is closed in composition first, so that no booking can
follow the state CANCELLED. The reason is stored even earlier: if this process dies in between, the
booking loop finds the reason and finishes the cancellation.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from skyway.contracts.mission import Cancellation, CancelMissions, Mission
from skyway.delivery.request import MAX_PACKAGES
from skyway.errors import InvalidInput
from skyway.ids import DeliveryId, PackageId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway_gateway.clients import DeliveryComposition
from skyway_gateway.deliveries.lifecycle.booking_effects import (
    after_booking,
    after_cancellation,
    can_be_cancelled,
    is_cancelled,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.lateness.lateness_forecast import host_delay


class CancelRequest(JsonModel):
    """What is to be cancelled: the whole delivery, or these packages; and why."""

    package_ids: Annotated[
        Annotated[tuple[PackageId, ...], Field(min_length=1, max_length=MAX_PACKAGES)] | None,
        Field(description="The packages to cancel; without them, the whole delivery."),
    ] = None
    reason: Annotated[
        Annotated[str, Field(max_length=500)] | None,
        Field(description="Why, at most 500 characters; events and packages show it."),
    ] = None


def requested_packages(delivery: Delivery, requested: CancelRequest) -> list[PackageStatus]:
    """The packages that a customer asks to cancel, in the order of the request.

    Raises
    ------
    InvalidInput
        The delivery has no such package.
    """
    if requested.package_ids is None:
        return list(delivery.packages)
    packages = {package.package_id: package for package in delivery.packages}
    for number, package_id in enumerate(requested.package_ids):
        if package_id not in packages:
            field = f"package_ids.{number}"
            raise InvalidInput(field, f"delivery {delivery.delivery_id} has no {package_id!r}")
    return [packages[package_id] for package_id in requested.package_ids]


def too_late(packages: Sequence[PackageStatus]) -> Conflict:
    """The error when none of these packages can be stopped."""
    states = ", ".join(f"{package.package_id} is {package.state}" for package in packages[:5])
    return Conflict("TOO_LATE", f"nothing can be stopped any more: {states}")


@dataclass(frozen=True, slots=True)
class Canceller:
    """Cancels deliveries."""

    db: Database
    composition: DeliveryComposition
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint

    async def cancel(
        self, caller: Caller, delivery_id: DeliveryId, requested: CancelRequest
    ) -> Delivery:
        """The delivery after everything that could be stopped is stopped.

        Cancelling again changes nothing.

        Raises
        ------
        NotFound
            There is no such delivery, or it is not the caller's.
        InvalidInput
            It has no such package.
        Conflict
            TOO_LATE: none of the requested packages can be stopped any more.
        ServiceUnavailable
            Composition does not answer now.
        """
        async with self.db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
        packages = requested_packages(delivery, requested)
        if not any(map(can_be_cancelled, packages)):
            if all(map(is_cancelled, packages)):
                return delivery
            raise too_late(packages)
        reason = requested.reason or f"cancelled by {caller.role} {caller.subject_id}"
        if requested.package_ids is None:
            async with self.db.write() as tx:
                await delivery_store.note_cancelling(tx, delivery_id, reason=reason)
        await self._stop(delivery, [one.package_id for one in packages], reason=reason)
        async with self.db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
        packages = requested_packages(delivery, requested)
        if not any(map(is_cancelled, packages)):
            raise too_late(packages)
        return delivery

    async def finish(self, delivery: Delivery) -> None:
        """Finish a cancellation of the whole delivery that another process began."""
        package_ids = [package.package_id for package in delivery.packages]
        await self._stop(delivery, package_ids, reason=delivery.cancel_reason or "cancelled")

    async def _stop(
        self, delivery: Delivery, package_ids: Sequence[PackageId], *, reason: str
    ) -> None:
        """Have composition stop these packages, and only then write that they are stopped."""
        if delivery.live_missions or _has_other_packages(delivery, package_ids):
            done = await self._cancel_missions(
                delivery, _carried(delivery, package_ids), reason=reason
            )
        else:
            done = await self._close(delivery, package_ids, reason=reason)
        await self.writer.write(
            delivery.delivery_id,
            change=lambda now: after_cancellation(
                now,
                package_ids,
                done,
                reason=reason,
                at=self.clock.now(),
                host_delay=host_delay(self.clock),
            ),
        )

    async def _close(
        self, delivery: Delivery, package_ids: Sequence[PackageId], *, reason: str
    ) -> Cancellation:
        """Close the delivery in composition, and cancel what was booked meanwhile."""
        closed = await self.composition.close(delivery.delivery_id)
        if closed.is_closed:
            return Cancellation()
        done = await self._cancel_missions(delivery, package_ids, reason=reason)
        if done.returning or done.too_late:
            await self._note_booked(delivery, closed.missions)
        await self.composition.close(delivery.delivery_id)
        return done

    async def _note_booked(self, delivery: Delivery, missions: Sequence[Mission]) -> None:
        """Write missions that composition has booked and a round of booking could not write.

        Their drones may have the packages, so the packages no longer wait.
        """
        booked = [each for each in missions if each.attempt == delivery.attempt]

        def plan(now: Delivery) -> Progress | None:
            if not booked or not now.is_queued or now.attempt != delivery.attempt:
                return None
            return after_booking(now, booked, at=self.clock.now())

        await self.writer.write(delivery.delivery_id, change=plan)

    async def _cancel_missions(
        self, delivery: Delivery, package_ids: Sequence[PackageId], *, reason: str
    ) -> Cancellation:
        if not package_ids:
            return Cancellation()
        asked = CancelMissions(
            cancellation_id=self.mint("cxl"), package_ids=tuple(package_ids), reason=reason
        )
        return await self.composition.cancel(delivery.delivery_id, asked)


def _has_other_packages(delivery: Delivery, package_ids: Collection[PackageId]) -> bool:
    """Whether other packages are still to be delivered."""
    return not all(
        package.is_settled or package.package_id in package_ids for package in delivery.packages
    )


def _carried(delivery: Delivery, package_ids: Collection[PackageId]) -> list[PackageId]:
    """These packages, as far as missions carry them; booking leaves out the others."""
    return [
        package.package_id
        for package in delivery.packages
        if package.package_id in package_ids
        and package.mission_id is not None
        and not package.is_settled
    ]
