"""The messages of the cloud in a run without a cloud: fleet time and missions."""

import asyncio
import math
import random
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.crew import PASSWORD
from skyway_lab.benchmarks.fleet.trip import trip_of

from skyway.contracts.topics import CLOCK, INSTRUCTIONS
from skyway.contracts.world import ClockAnchor
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.signing.seal import Seal

_CONNECT_WITHIN_S: Final = 20.0

#: Instructions that are sent together.
_TOGETHER: Final = 50


async def publish_clock(url: str) -> None:
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


async def send_missions(
    url: str,
    drones: Sequence[EnrolledDrone],
    *,
    seed: int,
    over_s: float,
    password: str = PASSWORD,
    seal: Seal | None = None,
) -> None:
    """Send each drone its trip, spread over so many seconds.

    Only composition's account may instruct drones, and drones that know its key obey its seal only.
    """
    chance = random.Random(seed)
    async with MqttClient(
        url, client_id="bench-sends", user_name="composition", password=password, seal=seal
    ) as composition:
        async with asyncio.timeout(_CONNECT_WITHIN_S):
            await composition.wait_connected()
        for first in range(0, len(drones), _TOGETHER):
            some = drones[first : first + _TOGETHER]
            async with asyncio.TaskGroup() as group:
                for drone in some:
                    bearing_rad = chance.uniform(0.0, 2 * math.pi)
                    group.create_task(_send_mission(composition, drone, bearing_rad=bearing_rad))
                group.create_task(asyncio.sleep(over_s * len(some) / len(drones)))


async def _send_mission(
    composition: MqttClient, drone: EnrolledDrone, *, bearing_rad: float
) -> None:
    trip = trip_of(drone, bearing_rad=bearing_rad, now=datetime.now(UTC))
    await composition.publish(INSTRUCTIONS(drone.provider_id, drone.drone_id), trip)
