"""What changes when packages are cancelled: waiting ones stay, loaded ones come back."""

from collections.abc import Collection
from datetime import datetime

from skyway.contracts.mission import Cancellation
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.progress import (
    CANCELLED_CODE,
    Progress,
    can_turn_back,
    changed,
    settled,
    with_cancelled,
    with_flags,
    with_returning,
)


def is_cancelled(package: PackageStatus) -> bool:
    """Whether the package is cancelled, or on its way back because of a cancellation."""
    is_too_late = package.state in ("DELIVERED", "STRANDED")
    return package.code == CANCELLED_CODE and not is_too_late


def can_be_cancelled(package: PackageStatus) -> bool:
    """Whether the package can still be kept from its recipient."""
    return can_turn_back(package) and not is_cancelled(package)


def after_cancellation(
    delivery: Delivery,
    requested: Collection[PackageId],
    done: Cancellation,
    *,
    reason: str,
    at: datetime,
) -> Progress:
    """The delivery after the requested packages were cancelled, as far as that was possible.

    `done` is what composition has stopped. Later mission reports repeat it and change nothing.
    """

    def stays(package: PackageStatus) -> bool:
        is_loose = package.is_waiting or package.package_id in done.released
        return package.package_id in requested and package.state == "CREATED" and is_loose

    without = with_cancelled(
        changed(delivery, updated_at=max(at, delivery.updated_at)),
        where=stays,
        code=CANCELLED_CODE,
        detail=reason,
        at=at,
    )
    returning = with_returning(without.delivery, done.returning, code=CANCELLED_CODE, detail=reason)
    progress = Progress(with_flags(returning), without.happenings)
    return settled(progress, at=at, code=CANCELLED_CODE, detail=reason)
