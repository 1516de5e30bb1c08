"""The tables of the gateway; `_ms` is fleet time, `_wall_ms` wall time, in ms since 1970."""

from skyway.runtime.idempotency.answer_store import idempotency_table
from skyway.runtime.outbox.outbox_store import outbox_table
from skyway_gateway.tables.access import api_keys, audit, audit_head
from skyway_gateway.tables.deliveries import custody, deliveries, missions, packages
from skyway_gateway.tables.metadata import metadata
from skyway_gateway.tables.notifications import events, notifications, webhook_attempts, webhooks
from skyway_gateway.tables.quotes import known_networks, quotes

__all__ = [
    "api_keys",
    "audit",
    "audit_head",
    "custody",
    "deliveries",
    "events",
    "idempotency",
    "known_networks",
    "metadata",
    "missions",
    "notifications",
    "outbox",
    "packages",
    "quotes",
    "webhook_attempts",
    "webhooks",
]

outbox = outbox_table(metadata)
idempotency = idempotency_table(metadata)
