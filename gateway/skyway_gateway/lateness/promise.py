"""The promised moments of a package, from the lateness that was learned."""

from datetime import datetime, timedelta

from skyway.delivery.lateness import later_by_s
from skyway.delivery.qos import QoS


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
