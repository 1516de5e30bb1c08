"""The fleet clock for everybody: over REST, and as a retained MQTT message."""

from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import Moment
from skyway.contracts.topics import CLOCK
from skyway.contracts.world import ClockAnchor
from skyway.json_model import JsonModel
from skyway.runtime.clock import AnchoredClock
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import MqttClient

#: Wall seconds between two messages: a drone that misses three of them knows the cloud is silent.
CLOCK_EVERY_S: Final = 30.0


class FleetTime(JsonModel):
    """Fleet time = fleet_at + (wall time - wall_at) * rate; `now` is fleet time at the answer."""

    fleet_at: Annotated[Moment, Field(description="Fleet time at the anchor.")]
    wall_at: Annotated[Moment, Field(description="Wall time at the anchor.")]
    rate: Annotated[
        float, Field(gt=0, description="Seconds of fleet time in one second of wall time, above 0.")
    ]
    now: Annotated[Moment, Field(description="Fleet time when this was answered.")]


def fleet_time(anchor: AnchoredClock) -> FleetTime:
    """The anchor and the fleet time now."""
    return FleetTime(
        fleet_at=anchor.fleet_at, wall_at=anchor.wall_at, rate=anchor.rate, now=anchor.now()
    )


async def publish_clock(mqtt: MqttClient, anchor: AnchoredClock, mint: Mint) -> None:
    """Publish the anchor as a retained message, again after each connect: brokers may lose it."""
    message = ClockAnchor(
        message_id=mint("msg"),
        sent_at=anchor.now(),
        fleet_at=anchor.fleet_at,
        wall_at=anchor.wall_at,
        rate=anchor.rate,
    )
    await mqtt.publish(CLOCK(), message)
