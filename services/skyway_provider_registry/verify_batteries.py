"""Verification of what was learned about drones and batteries, and of maintenance."""

import sys
from typing import Final

from sqlalchemy import Column, ColumnElement, and_, exists, or_, select

from skyway.drone.learned_values import CHARGE_RATE_BOUNDS, HEALTH_BOUNDS, STILL_AIR_BOUNDS
from skyway.runtime.verification.rule import Rule
from skyway_provider_registry.battery_tables import (
    batteries,
    maintenance_rules,
    past_installations,
)
from skyway_provider_registry.presence.maintenance_store import IS_OVER_LIMIT
from skyway_provider_registry.tables import drones, learned_values, presence, renewals

_LARGEST: Final = sys.float_info.max


def _is_no_sum(value: Column[float]) -> ColumnElement[bool]:
    """Whether a value is negative or infinite, so no sum of counts; False if it is null."""
    return ~value.between(0, _LARGEST)


_fits_drone = exists().where(
    drones.c.drone_id == batteries.c.drone_id,
    drones.c.provider_id == batteries.c.provider_id,
    drones.c.model_id == batteries.c.model_id,
)
_was_elsewhere_later = exists().where(
    past_installations.c.battery_id == batteries.c.battery_id,
    past_installations.c.removed_ms > batteries.c.installed_ms,
)
_later = past_installations.alias("later")
_overlaps_later = exists().where(
    _later.c.battery_id == past_installations.c.battery_id,
    _later.c.installed_ms > past_installations.c.installed_ms,
    _later.c.installed_ms < past_installations.c.removed_ms,
)

BATTERY_RULES: Final = (
    Rule(
        "what was learned about a drone is within its bounds",
        select(learned_values.c.drone_id).where(
            or_(
                ~learned_values.c.still_air_factor.between(*STILL_AIR_BOUNDS),
                # A flight counts as at most 0.25 away from the mean.
                ~learned_values.c.still_air_variance.between(0.0, 0.25**2),
                ~learned_values.c.state_of_health.between(*HEALTH_BOUNDS),
                ~learned_values.c.charge_rate_factor.between(*CHARGE_RATE_BOUNDS),
                learned_values.c.flights + learned_values.c.recharges < 1,
                ~learned_values.c.health_observations.between(
                    0, learned_values.c.flights + learned_values.c.recharges
                ),
                learned_values.c.learned_ms < learned_values.c.since_ms,
            )
        ),
        "Delete the row of `learned_values`: plans use the drone's model until it has flown again.",
    ),
    Rule(
        "what was learned about a drone follows its states",
        select(learned_values.c.drone_id)
        .join(presence, presence.c.drone_id == learned_values.c.drone_id)
        .where(
            or_(
                and_(
                    learned_values.c.learned_session == presence.c.state_session,
                    learned_values.c.learned_seq > presence.c.state_seq,
                ),
                and_(
                    presence.c.state_session.between(0, learned_values.c.learned_session - 1),
                    ~exists().where(renewals.c.drone_id == learned_values.c.drone_id),
                ),
            )
        ),
        "Nothing more is learned until the drone's states are later. Delete the row of "
        "`learned_values`: plans use the drone's model until it has flown again.",
    ),
    Rule(
        "a battery is in at most one drone, of its own provider and model",
        select(batteries.c.battery_id).where(
            or_(
                and_(batteries.c.drone_id.is_not(None), ~_fits_drone),
                batteries.c.drone_id.is_(None) != batteries.c.installed_ms.is_(None),
                batteries.c.drone_id.is_(None) != batteries.c.installed_used_soc.is_(None),
                _was_elsewhere_later,
            )
        ),
        "Ask the provider where the battery is. Set `drone_id`, `installed_ms` and "
        "`installed_used_soc` to NULL: the battery is in no drone until the provider installs it.",
    ),
    Rule(
        "a battery was in one drone after the other",
        select(past_installations.c.battery_id).where(
            or_(
                past_installations.c.removed_ms <= past_installations.c.installed_ms,
                _is_no_sum(past_installations.c.used_soc),
                _overlaps_later,
            )
        ),
        "Delete the row of `past_installations` that is wrong: it is only shown.",
    ),
    Rule(
        "what is known about a battery is possible",
        select(batteries.c.battery_id)
        .outerjoin(presence, presence.c.drone_id == batteries.c.drone_id)
        .where(
            or_(
                ~batteries.c.capacity_j.between(1, 1e12),
                ~batteries.c.state_of_health.between(*HEALTH_BOUNDS),
                batteries.c.health_observations < 0,
                _is_no_sum(batteries.c.used_soc),
                _is_no_sum(batteries.c.installed_used_soc),
                batteries.c.installed_used_soc > presence.c.used_soc,
            )
        ),
        "Set the value to what the provider measures. `installed_used_soc` is at most the "
        "`presence.used_soc` of the battery's drone.",
    ),
    Rule(
        "what a drone has flown is possible",
        select(presence.c.drone_id)
        .join(drones, drones.c.drone_id == presence.c.drone_id)
        .where(
            or_(
                _is_no_sum(presence.c.flown_s),
                _is_no_sum(presence.c.used_soc),
                ~drones.c.maintained_flown_s.between(0, presence.c.flown_s),
                ~drones.c.maintained_used_soc.between(0, presence.c.used_soc),
            )
        ),
        "Set `maintained_flown_s` and `maintained_used_soc` of `drones` to `flown_s` and "
        "`used_soc` of `presence`, which are sums and never negative.",
    ),
    Rule(
        "a maintenance rule has a limit",
        select(maintenance_rules.c.model_id).where(
            or_(
                and_(
                    maintenance_rules.c.every_flight_s.is_(None),
                    maintenance_rules.c.every_cycles.is_(None),
                ),
                maintenance_rules.c.every_flight_s <= 0,
                maintenance_rules.c.every_cycles <= 0,
            )
        ),
        "Have the provider set the rule again (PUT /v1/providers/{id}/maintenance-rules/{id}).",
    ),
    Rule(
        "a drone is due for maintenance if it is over a limit of its rule",
        select(drones.c.drone_id).where(drones.c.maintenance_due_ms.is_not(None) != IS_OVER_LIMIT),
        "Have the provider set the rule of the model again: all its drones are compared with it.",
    ),
)
