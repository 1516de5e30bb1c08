"""The loops of retention, as the settings ask for them."""

from collections.abc import Awaitable, Callable
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Loops, repeat
from skyway.runtime.sql.database import Database
from skyway_gateway.clients import Composition
from skyway_gateway.retention.prune_deliveries import DeliveryPruning
from skyway_gateway.retention.prune_logs import ExpiredPruning, LogPruning
from skyway_gateway.settings import GatewaySettings

#: Seconds of wall time between two steps. A step deletes 200 deliveries, so 100 a second end.
_DELIVERIES_EVERY_S: Final = 2.0
_LOGS_EVERY_S: Final = 60.0
_EXPIRED_EVERY_S: Final = 600.0

#: A step of a loop.
Step = Callable[[], Awaitable[bool]]


def start_pruning(
    loops: Loops,
    db: Database,
    clock: FleetClock,
    *,
    composition: Composition,
    claimant: str,
    settings: GatewaySettings,
    led: Callable[[Step], Step],
) -> None:
    """Start to delete what is older than the settings keep; `led` makes a step the leader's."""
    expired = ExpiredPruning(db, clock)
    loops.start("sweep", repeat("sweep", led(expired.step), every_s=_EXPIRED_EVERY_S))
    if settings.delivery_days is not None:
        deliveries = DeliveryPruning(
            db,
            composition,
            clock,
            claimant=claimant,
            kept=timedelta(days=settings.delivery_days),
        )
        step = repeat("old deliveries", led(deliveries.step), every_s=_DELIVERIES_EVERY_S)
        loops.start("old deliveries", step)
    logs = LogPruning(
        db,
        clock,
        audit_kept=_span(settings.audit_days),
        attempts_kept=_span(settings.webhook_attempt_days),
    )
    loops.start("old logs", repeat("old logs", led(logs.step), every_s=_LOGS_EVERY_S))


def _span(days: float | None) -> timedelta | None:
    return None if days is None else timedelta(days=days)
