"""The fleet clock as everybody may know it: by REST, and retained on MQTT."""

from typing import Annotated

from pydantic import AwareDatetime, Field

from skyway.contracts.topics import CLOCK
from skyway.contracts.world import ClockAnchor
from skyway.json_model import JsonModel
from skyway.runtime.clock import AnchoredClock
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt import MqttClient


class FleetTime(JsonModel):
    """Fleet time = fleet_at + (wall time - wall_at) * rate; `now` is fleet time at the answer."""

    fleet_at: AwareDatetime
    wall_at: AwareDatetime
    rate: Annotated[float, Field(gt=0)]
    now: AwareDatetime


def fleet_time(clock: AnchoredClock) -> FleetTime:
    """The anchor, and what it makes of now."""
    return FleetTime(
        fleet_at=clock.fleet_at, wall_at=clock.wall_at, rate=clock.rate, now=clock.now()
    )


async def publish_clock(mqtt: MqttClient, clock: AnchoredClock, mint: Mint) -> None:
    """Publish the anchor, retained; due after every connect, for a broker may have forgotten it."""
    anchor = ClockAnchor(
        message_id=mint("msg"),
        sent_at=clock.now(),
        fleet_at=clock.fleet_at,
        wall_at=clock.wall_at,
        rate=clock.rate,
    )
    await mqtt.publish(CLOCK(), anchor)
