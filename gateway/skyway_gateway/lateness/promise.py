"""The promised moments of a package, and from when on it is late."""

from datetime import datetime, timedelta
from typing import Final

from skyway.delivery.lateness import later_by_s
from skyway.delivery.qos import QoS
from skyway.runtime.clock import FleetClock

#: What messages and programs may take, wall seconds. In a simulation whose time runs faster than
#: that of the machine this looks like lateness of drones.
_HOST_TAKES_S: Final = 5.0


def host_delay(clock: FleetClock) -> timedelta:
    """The lateness in fleet time that the machine alone may have caused; nothing in real time."""
    return timedelta(seconds=_HOST_TAKES_S * max(0.0, clock.rate - 1.0))


def host_delay_ms(clock: FleetClock) -> int:
    """`host_delay` in milliseconds of fleet time."""
    return round(host_delay(clock) / timedelta(milliseconds=1))


def p90_of(eta_at: datetime, *, start_at: datetime, share: float | None) -> datetime | None:
    """The P90 of a package that is planned to come at `eta_at`; None if no share is known."""
    if share is None:
        return None
    planned_s = (eta_at - start_at).total_seconds()
    return eta_at + timedelta(seconds=later_by_s(planned_s, share))


def due_of(eta_at: datetime, p90_at: datetime | None, qos: QoS) -> datetime:
    """The promise from which lateness counts: the P90 if asked and known, else the ETA.

    The seconds that the customer allows (`may_be_later_s`) are added, up to the deadline.
    """
    promised_at = p90_at if p90_at is not None and qos.promise == "P90" else eta_at
    due_at = promised_at + timedelta(seconds=qos.may_be_later_s)
    return due_at if qos.deadline_at is None else max(promised_at, min(due_at, qos.deadline_at))
