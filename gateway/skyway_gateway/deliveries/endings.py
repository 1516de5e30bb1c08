"""How a delivery ends: when all its packages have, by how they have."""

from datetime import datetime
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway_gateway.deliveries import told
from skyway_gateway.deliveries.delivery import Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.progress import Progress, changed
from skyway_gateway.deliveries.states import DeliveryState
from skyway_gateway.notifications.events import Happening

#: Why a package that somebody did not want any more was not delivered.
CANCELLED_CODE: Final = "CANCELLED"


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
    data = told.completed(end) if end.state == "COMPLETED" else told.ended(end, code, detail)
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
