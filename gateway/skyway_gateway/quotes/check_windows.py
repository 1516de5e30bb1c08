"""Checks the windows of a request: each alone, and those that have to be met together."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final, NamedTuple

from skyway.contracts.message import utc_text
from skyway.delivery.request import DeliveryRequest, Package
from skyway.errors import InvalidInput

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
