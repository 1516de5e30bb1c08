"""What all changes of a delivery have in common: the changed delivery, its events, its end."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.delivery import (
    Delivery,
    DeliveryState,
    Flags,
    PackageStatus,
)
from skyway_gateway.notifications.delivery_events import Happening

#: The code of a package that somebody cancelled.
CANCELLED_CODE: Final = "CANCELLED"


@dataclass(frozen=True, slots=True)
class Progress:
    """A delivery after something happened, and its new events in order."""

    delivery: Delivery
    happenings: tuple[Happening, ...] = ()


def changed(delivery: Delivery, **changes: object) -> Delivery:
    """The delivery with other field values."""
    return delivery.model_copy(update=changes)


def with_packages(
    delivery: Delivery,
    change: Callable[[PackageStatus], Mapping[str, object]],
    *,
    where: Callable[[PackageStatus], bool],
) -> Delivery:
    """The delivery with other field values in some of its packages."""
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
    """The delivery with these packages cancelled at the pickup, and one event for each.

    A package that was already to come back keeps its first reason.
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
    """The delivery with packages that come back; packages not loaded yet turn back once loaded."""

    def turn_back(package: PackageStatus) -> Mapping[str, object]:
        state = package.state if package.state == "CREATED" else "RETURNING"
        return {"state": state, "code": code, "detail": detail}

    return with_packages(
        delivery,
        turn_back,
        where=lambda one: one.package_id in package_ids and can_turn_back(one),
    )


def can_turn_back(package: PackageStatus) -> bool:
    """Whether the package is still meant for its recipient."""
    return package.state in ("CREATED", "LOADED", "IN_TRANSIT")


def is_replanning(delivery: Delivery) -> bool:
    """Whether a plan of this delivery no longer holds and no new plan exists yet."""
    is_refused = bool(delivery.refusals) and bool(delivery.waiting_packages)
    return is_refused or any(mission.is_replanning for mission in delivery.live_missions)


def with_flags(delivery: Delivery) -> Delivery:
    """The delivery with its `replanning` flag brought up to date."""
    flags = delivery.flags.model_copy(update={"replanning": is_replanning(delivery)})
    return changed(delivery, flags=flags)


def settled(
    progress: Progress, *, at: datetime, code: str | None = None, detail: str | None = None
) -> Progress:
    """The ended delivery with its final event, if all its packages are settled; else no change.

    Without a code, the event gives the reason of the first package that was not delivered.
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
    """Whether the package was cancelled and is at a station again."""
    return package.state in ("CANCELLED", "RETURNED") and package.code == CANCELLED_CODE
