"""Pads that somebody else stands on: until when a drone that came must wait."""

import math
from datetime import UTC, datetime, timedelta

from skyway.contracts.flight_step import RechargeStep
from skyway_drone_agent.simulated.chance import happens
from skyway_drone_agent.simulated.disturbances import Disturbances


def pad_free_at(step: RechargeStep, arrived_at: datetime, *, disturbed: Disturbances) -> datetime:
    """When the pad of this recharge is first free, from the arrival on; the drone stays on it."""
    free_at = arrived_at
    while (later := _taken_until(step, free_at, disturbed=disturbed)) > free_at:
        free_at = later
    return free_at


def _taken_until(step: RechargeStep, at: datetime, *, disturbed: Disturbances) -> datetime:
    """The end of what keeps the pad at this moment; the moment itself when nothing does."""
    pads, until_at = disturbed.pads, at
    for taken in pads.taken:
        is_this = taken.station_id == step.station_id and taken.pad in (None, step.pad)
        if is_this and taken.from_at <= at < taken.until_at:
            until_at = max(until_at, taken.until_at)
    if pads.taken_share > 0.0:
        span = math.floor(at.timestamp() / pads.taken_s)
        if happens(pads.taken_share, disturbed.seed, "pad", step.station_id, step.pad, span):
            ended = datetime.fromtimestamp(0, UTC) + timedelta(seconds=(span + 1) * pads.taken_s)
            until_at = max(until_at, ended)
    return until_at
