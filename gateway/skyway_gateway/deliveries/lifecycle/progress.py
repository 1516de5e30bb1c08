"""A delivery after something happened, and what to tell of it: what all changes have in common.

Pure, like `booking`, `reports`, `cancelling` and `endings` beside it: a delivery and what happened
in, the delivery afterwards and what to tell out.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.lifecycle.states import DeliveryState
from skyway_gateway.notifications.record_events import Happening

#: Why a package that somebody did not want any more was not delivered.
CANCELLED_CODE: Final = "CANCELLED"


@dataclass(frozen=True, slots=True)
class Progress:
    """A delivery after something happened, and what to tell of it, in order."""

    delivery: Delivery
    happenings: tuple[Happening, ...] = ()


def changed(delivery: Delivery, **changes: object) -> Delivery:
    """The delivery with other members."""
    return delivery.model_copy(update=changes)


def with_packages(
    delivery: Delivery,
    change: Callable[[PackageStatus], Mapping[str, object]],
    *,
    where: Callable[[PackageStatus], bool],
) -> Delivery:
    """The delivery with other members in some of its packages."""
    packages = tuple(
        one.model_copy(update=change(one)) if where(one) else one for one in delivery.packages
    )
    return changed(delivery, packages=packages)


def with_cancelled(
    delivery: Delivery,
    *,
    where: Callable[[PackageStatus], bool],
    code: str | None,
    detail: str | None,
    at: datetime,
) -> Progress:
    """The delivery without these packages, which never left the pickup; each is told.

    Of a package that was to come back anyway, the reason for that is the one that counts.
    """

    def cancel(package: PackageStatus) -> Mapping[str, object]:
        why = (package.code, package.detail) if package.code is not None else (code, detail)
        return {"state": "CANCELLED", "eta_at": None, "code": why[0], "detail": why[1]}

    after = with_packages(delivery, cancel, where=where)
    return Progress(
        after,
        tuple(
            Happening(DeliveryEventType.PACKAGE_CANCELLED, at, event_data.package_cancelled(now))
            for before, now in zip(delivery.packages, after.packages, strict=True)
            if before.state != now.state
        ),
    )


def with_returning(
    delivery: Delivery, package_ids: Collection[PackageId], *, code: str | None, detail: str | None
) -> Delivery:
    """The delivery with packages that come back; those not loaded yet do so once they are."""

    def turn_back(package: PackageStatus) -> Mapping[str, object]:
        state = package.state if package.state == "CREATED" else "RETURNING"
        return {"state": state, "code": code, "detail": detail}

    return with_packages(
        delivery,
        turn_back,
        where=lambda one: one.package_id in package_ids and can_turn_back(one),
    )


def can_turn_back(package: PackageStatus) -> bool:
    """Whether it is still on its way to its recipient."""
    return package.state in ("CREATED", "LOADED", "IN_TRANSIT")


def is_replanning(delivery: Delivery) -> bool:
    """Whether a plan that the customer knew does not hold, and there is no other yet."""
    is_refused = bool(delivery.refusals) and bool(delivery.waiting)
    return is_refused or any(mission.is_replanning for mission in delivery.live_missions)


def with_flags(delivery: Delivery) -> Delivery:
    """The delivery with the flag that says whether it is being planned anew."""
    flags = delivery.flags.model_copy(update={"replanning": is_replanning(delivery)})
    return changed(delivery, flags=flags)


def settled(
    progress: Progress, *, at: datetime, code: str | None = None, detail: str | None = None
) -> Progress:
    """The end of the delivery, if all its packages are settled now; else as it was.

    Without a code of the last report, it is told why the first package was not delivered.
    """
    delivery = progress.delivery
    if delivery.is_over or not all(package.is_settled for package in delivery.packages):
        return progress
    end = changed(delivery, state=_end_of(delivery), activity=None, flags=Flags(), updated_at=at)
    if code is None:
        code, detail = next(
            ((one.code, one.detail) for one in end.packages if one.state != "DELIVERED"),
            (None, None),
        )
    data = (
        event_data.completed(end)
        if end.state == "COMPLETED"
        else event_data.ended(end, code, detail)
    )
    kind = DeliveryEventType(f"delivery.{end.state.lower()}")
    return Progress(end, (*progress.happenings, Happening(kind, at, data)))


def _end_of(delivery: Delivery) -> DeliveryState:
    are_delivered = [package.state == "DELIVERED" for package in delivery.packages]
    if all(are_delivered):
        return "COMPLETED"
    if any(are_delivered):
        return "PARTIALLY_COMPLETED"
    return "CANCELLED" if all(map(_is_cancelled, delivery.packages)) else "FAILED"


def _is_cancelled(package: PackageStatus) -> bool:
    """Whether it was not to be delivered, and is where it came from."""
    return package.state in ("CANCELLED", "RETURNED") and package.code == CANCELLED_CODE
