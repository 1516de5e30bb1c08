"""Verification of drones' credentials and telemetry, of learned values, batteries, maintenance."""

import sys
from typing import Final

from skyway_provider_registry.fleets.issue_credentials import TOKEN_LIFE
from skyway_provider_registry.presence.maintenance_store import IS_OVER_LIMIT
from skyway_provider_registry.tables import (
    batteries,
    broker_accounts,
    drone_keys,
    drone_signing_keys,
    drones,
    enrolment_tokens,
    learned_values,
    maintenance_rules,
    past_installations,
    presence,
    renewals,
    telemetry_minutes,
    telemetry_samples,
    waiting_alarms,
)
from sqlalchemy import Column, ColumnElement, and_, exists, false, func, or_, select

from skyway.bounds import LATEST
from skyway.drone.learned_values import CHARGE_RATE_BOUNDS, HEALTH_BOUNDS, STILL_AIR_BOUNDS
from skyway.units import moment_to_ms
from skyway_verifier.finders import any_of
from skyway_verifier.rule import Rule
from skyway_verifier.storage_rules import later_than

_LARGEST: Final = sys.float_info.max
_LATEST_MS: Final = moment_to_ms(LATEST)


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


def is_outside(longitude: Column[float], latitude: Column[float]) -> ColumnElement[bool]:
    """Whether a place is nowhere on earth; False if it is not known."""
    return or_(~longitude.between(-180, 180), ~latitude.between(-90, 90))


def _is_endless(value: Column[float]) -> ColumnElement[bool]:
    return ~value.between(-sys.float_info.max, sys.float_info.max)


_is_blocked = broker_accounts.c.revoked_wall_ms.is_not(None)

DRONE_RULES: Final = (
    Rule(
        "a drone that has ever signed has the row of its key",
        select(drones.c.drone_id)
        .outerjoin(drone_signing_keys, drone_signing_keys.c.drone_id == drones.c.drone_id)
        .where(drones.c.is_signing != func.coalesce(drone_signing_keys.c.is_required, false())),
        "The row of `drone_signing_keys` was deleted or changed, so nothing of the drone is "
        "believed. Restore the row from a backup, or give the drone a new enrolment token (POST "
        "/v1/providers/{id}/drones/{id}/enrolment-tokens): it enrols with its key again.",
    ),
    Rule(
        "a drone's token, key and account fit one another",
        select(drones.c.drone_id)
        .join(broker_accounts, broker_accounts.c.user_name == drones.c.drone_id)
        .outerjoin(drone_keys, drone_keys.c.drone_id == drones.c.drone_id)
        .outerjoin(enrolment_tokens, enrolment_tokens.c.drone_id == drones.c.drone_id)
        .where(
            or_(
                # A revocation blocks the account, and deletes token and key.
                and_(_is_blocked, drone_keys.c.drone_id.is_not(None)),
                and_(~_is_blocked, enrolment_tokens.c.drone_id.is_(None)),
                and_(enrolment_tokens.c.used_wall_ms.is_not(None), drone_keys.c.drone_id.is_(None)),
                enrolment_tokens.c.used_wall_ms > enrolment_tokens.c.expires_wall_ms,
                drone_keys.c.next_key_hash.is_(None) != drone_keys.c.next_password_hash.is_(None),
            )
        ),
        "A revocation was undone, or a row was deleted: others may have the credentials. Revoke "
        "them (DELETE /v1/providers/{id}/drones/{id}/credentials), and let the drone enrol again.",
    ),
    Rule(
        "an enrolment token lasts no longer than its span",
        later_than(
            lambda survey: survey.wall_ms + round(TOKEN_LIFE.total_seconds() * 1000) + 600_000,
            [enrolment_tokens.c.expires_wall_ms],
        ),
        "Give the drone another token (POST /v1/providers/{id}/drones/{id}/enrolment-tokens): it "
        "replaces this one.",
    ),
    Rule(
        "a waiting alarm is about its drone",
        select(waiting_alarms.c.drone_id).where(
            ~waiting_alarms.c.alarm.contains('"drone_id":"' + waiting_alarms.c.drone_id + '"')
        ),
        "Delete the row of `waiting_alarms`: the alarm is raised again when it is still true.",
    ),
    Rule(
        "credentials were renewed at a possible moment",
        any_of(
            renewals.c.drone_id,
            ~renewals.c.renewed_ms.between(0, _LATEST_MS),
            ~renewals.c.renewed_wall_ms.between(0, _LATEST_MS),
        ),
        "Set both moments to now and `is_announced` to false: composition is notified again.",
    ),
    Rule(
        "a sample of telemetry is possible",
        any_of(
            telemetry_samples.c.drone_id,
            is_outside(telemetry_samples.c.longitude_deg, telemetry_samples.c.latitude_deg),
            ~telemetry_samples.c.soc.between(0, 1),
            _is_endless(telemetry_samples.c.power_w),
            _is_endless(telemetry_samples.c.speed_mps),
        ),
        "Delete the row of `telemetry_samples`: it is a measurement, and nothing depends on it.",
    ),
    Rule(
        "a minute of telemetry has samples, and means between the least and the greatest",
        any_of(
            telemetry_minutes.c.drone_id,
            telemetry_minutes.c.samples < 1,
            is_outside(telemetry_minutes.c.longitude_deg, telemetry_minutes.c.latitude_deg),
            ~telemetry_minutes.c.min_soc.between(0, 1),
            ~telemetry_minutes.c.max_soc.between(0, 1),
            *(
                ~telemetry_minutes.c[name].between(
                    telemetry_minutes.c[f"min_{name}"] - tolerance,
                    telemetry_minutes.c[f"max_{name}"] + tolerance,
                )
                # Means are rounded.
                for name, tolerance in (("soc", 1e-6), ("power_w", 1e-3), ("speed_mps", 1e-3))
            ),
        ),
        "Delete the row of `telemetry_minutes`: it is a measurement, and nothing depends on it.",
    ),
    Rule(
        "what was learned about a drone is within its bounds",
        any_of(
            learned_values.c.drone_id,
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
        any_of(
            batteries.c.battery_id,
            and_(batteries.c.drone_id.is_not(None), ~_fits_drone),
            batteries.c.drone_id.is_(None) != batteries.c.installed_ms.is_(None),
            batteries.c.drone_id.is_(None) != batteries.c.installed_used_soc.is_(None),
            _was_elsewhere_later,
        ),
        "Ask the provider where the battery is. Set `drone_id`, `installed_ms` and "
        "`installed_used_soc` to NULL: the battery is in no drone until the provider installs it.",
    ),
    Rule(
        "a battery was in one drone after the other",
        any_of(
            past_installations.c.battery_id,
            past_installations.c.removed_ms <= past_installations.c.installed_ms,
            _is_no_sum(past_installations.c.used_soc),
            _overlaps_later,
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
        any_of(
            maintenance_rules.c.model_id,
            and_(
                maintenance_rules.c.every_flight_s.is_(None),
                maintenance_rules.c.every_cycles.is_(None),
            ),
            maintenance_rules.c.every_flight_s <= 0,
            maintenance_rules.c.every_cycles <= 0,
        ),
        "Have the provider set the rule again (PUT /v1/providers/{id}/maintenance-rules/{id}).",
    ),
    Rule(
        "a drone is due for maintenance if it is over a limit of its rule",
        select(drones.c.drone_id).where(drones.c.maintenance_due_ms.is_not(None) != IS_OVER_LIMIT),
        "Have the provider set the rule of the model again: all its drones are compared with it.",
    ),
)
