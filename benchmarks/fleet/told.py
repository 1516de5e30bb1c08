"""What the cloud tells drones in a run without one: fleet time, and what to fly."""

import asyncio
import math
import random
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from skyway_drone_agent.enrolled_drone import EnrolledDrone

from benchmarks.fleet.crew import PASSWORD
from benchmarks.fleet.trip import trip_of
from skyway.contracts.topics import CLOCK, INSTRUCTIONS
from skyway.contracts.world import ClockAnchor
from skyway.runtime.mqtt.client import MqttClient

_CONNECT_WITHIN_S: Final = 20.0

#: Instructions on their way at a time.
_AT_ONCE: Final = 50


async def tell_time(url: str) -> None:
    """Publish the fleet clock: wall time, at production's rate of 1."""
    moment = datetime.now(UTC)
    anchor = ClockAnchor(
        message_id="msg_clock", sent_at=moment, fleet_at=moment, wall_at=moment, rate=1.0
    )
    async with MqttClient(
        url, client_id="bench-clock", user_name="gateway", password=PASSWORD
    ) as gateway:
        async with asyncio.timeout(_CONNECT_WITHIN_S):
            await gateway.wait_connected()
        await gateway.publish(CLOCK(), anchor)


async def send_off(
    url: str,
    drones: Sequence[EnrolledDrone],
    *,
    seed: int,
    over_s: float,
    password: str = PASSWORD,
) -> None:
    """Have each drone fly its trip, one after another over so many seconds.

    With composition's account, which alone may instruct drones.
    """
    chance = random.Random(seed)
    async with MqttClient(
        url, client_id="bench-tells", user_name="composition", password=password
    ) as composition:
        async with asyncio.timeout(_CONNECT_WITHIN_S):
            await composition.wait_connected()
        for first in range(0, len(drones), _AT_ONCE):
            some = drones[first : first + _AT_ONCE]
            async with asyncio.TaskGroup() as group:
                for drone in some:
                    bearing_rad = chance.uniform(0.0, 2 * math.pi)
                    group.create_task(_tell(composition, drone, bearing_rad=bearing_rad))
                group.create_task(asyncio.sleep(over_s * len(some) / len(drones)))


async def _tell(composition: MqttClient, drone: EnrolledDrone, *, bearing_rad: float) -> None:
    trip = trip_of(drone, bearing_rad=bearing_rad, now=datetime.now(UTC))
    await composition.publish(INSTRUCTIONS(drone.provider_id, drone.drone_id), trip)
