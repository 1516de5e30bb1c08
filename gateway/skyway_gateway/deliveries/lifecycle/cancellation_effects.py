"""What a cancellation does to a delivery: what waits stays, what is on board comes back."""

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
    """Whether a cancellation has stopped it, or is about to."""
    is_past_that = package.state in ("DELIVERED", "STRANDED")
    return package.code == CANCELLED_CODE and not is_past_that


def can_be_cancelled(package: PackageStatus) -> bool:
    """Whether something about it can still be stopped."""
    return can_turn_back(package) and not is_cancelled(package)


def after_cancellation(
    delivery: Delivery,
    wanted: Collection[PackageId],
    done: Cancellation,
    *,
    reason: str,
    at: datetime,
) -> Progress:
    """The delivery without those of the wanted packages that still wait, or were `done`.

    The mission reports that follow say the same again, and change nothing more.
    """

    def stays(package: PackageStatus) -> bool:
        is_loose = package.is_waiting or package.package_id in done.released
        return package.package_id in wanted and package.state == "CREATED" and is_loose

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
