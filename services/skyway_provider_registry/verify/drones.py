"""The rules of drones: each has a presence, an account and a model."""

import sys
from typing import Final

from sqlalchemy import Column, ColumnElement, and_, or_, select

from skyway.drone.models import DRONE_MODELS
from skyway.runtime.verification.rule import Rule
from skyway_provider_registry.tables import (
    broker_accounts,
    drone_models,
    drones,
    presence,
    telemetry_samples,
)

_is_drone_account = broker_accounts.c.kind == "DRONE"


def _is_outside(longitude: Column[float], latitude: Column[float]) -> ColumnElement[bool]:
    """Whether a place is nowhere on earth; False if it is not known."""
    return or_(~longitude.between(-180, 180), ~latitude.between(-90, 90))


def _is_endless(value: Column[float]) -> ColumnElement[bool]:
    return ~value.between(-sys.float_info.max, sys.float_info.max)


DRONES: Final = (
    Rule(
        "every drone has a broker account",
        select(drones.c.drone_id).where(
            drones.c.drone_id.not_in(select(broker_accounts.c.user_name).where(_is_drone_account))
        ),
        "The broker refuses the drone. Give it a new enrolment token (POST "
        "/v1/providers/{id}/drones/{id}/enrolment): enrolling opens an account, once its row "
        "exists: restore the row of `broker_accounts` from a backup first.",
    ),
    Rule(
        "every drone's broker account has a drone",
        select(broker_accounts.c.user_name).where(
            _is_drone_account, broker_accounts.c.user_name.not_in(select(drones.c.drone_id))
        ),
        "If the drone was removed, delete the row of `broker_accounts`. If not, restore the drone "
        "with its presence from a backup.",
    ),
    Rule(
        "every drone has one presence",
        select(drones.c.drone_id).where(drones.c.drone_id.not_in(select(presence.c.drone_id))),
        "Restore the row of `presence` from a backup; the drone's next messages fill it again.",
    ),
    Rule(
        "every presence has a drone",
        select(presence.c.drone_id).where(presence.c.drone_id.not_in(select(drones.c.drone_id))),
        "If the drone was removed, delete the row of `presence`. If not, restore the drone.",
    ),
    Rule(
        "every drone has an existing model",
        select(drones.c.drone_id).where(
            drones.c.model_id.not_in(select(drone_models.c.model_id)),
            drones.c.model_id.not_in(list(DRONE_MODELS)),
        ),
        "Add the model again (PUT /v1/drone-models/{id}), with the values that the missions of the "
        "drone show in composition's `missions.candidate`.",
    ),
    Rule(
        "a drone's charge and place are possible",
        select(presence.c.drone_id).where(
            or_(
                ~presence.c.soc.between(0, 1),
                _is_outside(presence.c.longitude_deg, presence.c.latitude_deg),
                _is_outside(presence.c.sample_longitude_deg, presence.c.sample_latitude_deg),
                ~presence.c.sample_soc.between(0, 1),
                (presence.c.activity.is_(None)) != (presence.c.state_at_ms.is_(None)),
                and_(
                    presence.c.activity.is_not(None),
                    or_(
                        presence.c.longitude_deg.is_(None),
                        presence.c.latitude_deg.is_(None),
                        presence.c.soc.is_(None),
                    ),
                ),
            )
        ),
        "The drone's next state fills the row again. Set `state_session` and `state_seq` to -1, "
        "so that it is accepted.",
    ),
    Rule(
        "a drone's home is on earth, and its first charge possible",
        select(drones.c.drone_id).where(
            or_(
                _is_outside(drones.c.home_longitude_deg, drones.c.home_latitude_deg),
                ~drones.c.initial_soc.between(0, 1),
            )
        ),
        "Set the home to the place of the station `home_station_id`: see GET /v1/networks.",
    ),
    Rule(
        "a sample of telemetry is possible",
        select(telemetry_samples.c.drone_id).where(
            or_(
                _is_outside(telemetry_samples.c.longitude_deg, telemetry_samples.c.latitude_deg),
                ~telemetry_samples.c.soc.between(0, 1),
                _is_endless(telemetry_samples.c.power_w),
                _is_endless(telemetry_samples.c.speed_mps),
            )
        ),
        "Delete the row of `telemetry_samples`: it is a measurement, and nothing depends on it.",
    ),
)
