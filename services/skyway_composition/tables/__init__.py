"""The tables of composition; `_ms` is fleet time and `_wall_ms` is wall time, ms since 1970."""

from skyway.runtime.outbox.outbox_store import outbox_table
from skyway.runtime.replicas.replica_store import replicas_table
from skyway_composition.tables.links import drone_links, instructions, no_shows, quarantine
from skyway_composition.tables.missions import (
    alarms,
    better_orders,
    cancellations,
    custody,
    cut_steps,
    deliveries,
    first_planned_end_ms,
    guests,
    is_live,
    is_open,
    is_queued,
    is_under_way,
    mission_steps,
    missions,
    offer_holds,
    proofs,
)
from skyway_composition.tables.networks import (
    closures,
    forecasts,
    metadata,
    network_versions,
    networks,
    pad_reservations,
    stations,
)

__all__ = [
    "alarms",
    "better_orders",
    "cancellations",
    "closures",
    "custody",
    "cut_steps",
    "deliveries",
    "drone_links",
    "first_planned_end_ms",
    "forecasts",
    "guests",
    "instructions",
    "is_live",
    "is_open",
    "is_queued",
    "is_under_way",
    "metadata",
    "mission_steps",
    "missions",
    "network_versions",
    "networks",
    "no_shows",
    "offer_holds",
    "outbox",
    "pad_reservations",
    "proofs",
    "quarantine",
    "replicas",
    "stations",
]

outbox = outbox_table(metadata)
replicas = replicas_table(metadata)
