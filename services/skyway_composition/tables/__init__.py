"""The tables of composition; `_ms` is fleet time, `_wall_ms` wall time, in ms since 1970."""

from skyway.runtime.outbox.table import outbox_table
from skyway_composition.tables.alarms import alarms
from skyway_composition.tables.closures import closures
from skyway_composition.tables.links import drone_links, instructions
from skyway_composition.tables.metadata import metadata
from skyway_composition.tables.missions import deliveries, is_live, is_under_way, missions
from skyway_composition.tables.networks import network_versions, networks, stations
from skyway_composition.tables.packages import cancellations, custody
from skyway_composition.tables.pads import pad_reservations
from skyway_composition.tables.steps import cut_steps, first_planned_end_ms, mission_steps

__all__ = [
    "alarms",
    "cancellations",
    "closures",
    "custody",
    "cut_steps",
    "deliveries",
    "drone_links",
    "first_planned_end_ms",
    "instructions",
    "is_live",
    "is_under_way",
    "metadata",
    "mission_steps",
    "missions",
    "network_versions",
    "networks",
    "outbox",
    "pad_reservations",
    "stations",
]

outbox = outbox_table(metadata)
