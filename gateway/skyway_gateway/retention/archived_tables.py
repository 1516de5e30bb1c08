"""What the gateway archives: deliveries that are over, with their parts; the audit log; attempts.

Keys, webhooks, sessions and stored answers are secret or hold secrets, and are not archived.
"""

from typing import Final

from sqlalchemy import Table, and_, true

from skyway.runtime.archive import ArchivedTable
from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES
from skyway_gateway.delivery_tables import custody, deliveries, is_live_row, missions, packages
from skyway_gateway.tables import audit, events, webhook_attempts

#: How the processes share work, and a cache of what the events say.
_OF_QUEUE: Final = frozenset(
    {
        "is_queued",
        "next_try_wall_ms",
        "queue_rank",
        "waits_since_ms",
        "woken_wall_ms",
        "version",
        "is_leaving",
        "claimed_by",
        "claimed_until_ms",
    }
)

#: Archives have no test deliveries.
_is_over: Final = and_(
    deliveries.c.state.in_(sorted(TERMINAL_STATES)), is_live_row(deliveries.c.customer_id)
)


def _part(table: Table) -> ArchivedTable:
    """A table of parts of deliveries; its rows have the day of their delivery's end."""
    source = table.join(deliveries, deliveries.c.delivery_id == table.c.delivery_id)
    return ArchivedTable(table, deliveries.c.updated_ms, source, _is_over)


ARCHIVED: Final = (
    ArchivedTable(deliveries, deliveries.c.updated_ms, deliveries, _is_over, _OF_QUEUE),
    *map(_part, (packages, custody, missions, events)),
    ArchivedTable(audit, audit.c.at_wall_ms, audit, true()),
    ArchivedTable(webhook_attempts, webhook_attempts.c.at_wall_ms, webhook_attempts, true()),
)
