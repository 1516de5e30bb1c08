"""A link with outages, as a scenario says."""

import asyncio
import math
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from types import TracebackType
from typing import Any, Self

from skyway.contracts.topics import Address, M, Topic
from skyway.ids import DroneId
from skyway.runtime.clock import sleep_wall
from skyway.runtime.mqtt.client import MqttClient, Received
from skyway_drone_agent.clock_keeper import ClockFromCloud
from skyway_drone_agent.simulated.disturbances import Disturbances, uniforms

_EPOCH = datetime.fromtimestamp(0, UTC)


@dataclass(frozen=True, slots=True)
class Outage:
    """A time in which a link is down."""

    from_at: datetime
    until_at: datetime


def outages(after: datetime, *, disturbed: Disturbances, drone_id: DroneId) -> Iterator[Outage]:
    """The outages of this drone's link that end after a moment, without end.

    Only for drones for which `has_outages` is true: other drones have no next outage.
    """
    loss = disturbed.link
    span = math.floor(after.timestamp() / loss.every_s)
    while True:
        is_lost, share, *_ = uniforms(disturbed.seed, "link", drone_id, span)
        if is_lost < loss.share:
            begin_s = span * loss.every_s + share * (loss.every_s - loss.for_s)
            from_at = _EPOCH + timedelta(seconds=begin_s)
            outage = Outage(from_at, from_at + timedelta(seconds=loss.for_s))
            if outage.until_at > after:
                yield outage
        span += 1


def has_outages(disturbed: Disturbances, drone_id: DroneId) -> bool:
    """Whether this drone's link has outages in the scenario."""
    loss = disturbed.link
    return loss.share > 0.0 and (loss.drone_ids is None or drone_id in loss.drone_ids)


class LinkWithOutages:
    """The drone's connection, which is dropped in each outage without a goodbye."""

    def __init__(
        self,
        client: MqttClient,
        clock: ClockFromCloud,
        *,
        disturbed: Disturbances,
        drone_id: DroneId,
    ) -> None:
        self._client = client
        self._clock = clock
        self._disturbed = disturbed
        self._drone_id = drone_id
        self._losing: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        await self._client.__aenter__()
        self._losing = asyncio.create_task(self._drop_in_outages())
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        if self._losing is not None:
            self._losing.cancel()
            with suppress(asyncio.CancelledError):
                await self._losing
        await self._client.__aexit__(kind, error, trace)

    @property
    def is_connected(self) -> bool:
        """Whether the broker has accepted us."""
        return self._client.is_connected

    async def wait_connected(self) -> None:
        """Return once the broker has accepted us."""
        await self._client.wait_connected()

    async def wait_lost(self) -> None:
        """Return once the broker cannot be reached."""
        await self._client.wait_lost()

    async def publish(self, address: Address[M], message: M, *, timeout_s: float = 5.0) -> None:
        """Publish over the connection; during an outage this fails."""
        await self._client.publish(address, message, timeout_s=timeout_s)

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        """The messages that arrive on these topics. Any: each topic has its own message type."""
        return self._client.batches(*subscriptions)

    async def _drop_in_outages(self) -> None:
        await self._clock.wait_until_set()
        for outage in outages(self._now(), disturbed=self._disturbed, drone_id=self._drone_id):
            await self._sleep_until(outage.from_at)
            self._client.drop()
            await self._client.__aexit__(None, None, None)
            try:
                await self._sleep_until(outage.until_at)
            finally:
                await self._client.__aenter__()

    def _now(self) -> datetime:
        by_wall = self._disturbed.link.seconds == "wall"
        return self._clock.wall_now() if by_wall else self._clock.now()

    async def _sleep_until(self, moment: datetime) -> None:
        if self._disturbed.link.seconds == "fleet":
            await self._clock.sleep_until(moment)
        else:
            left_s = (moment - self._clock.wall_now()).total_seconds()
            await sleep_wall(self._clock, max(0.0, left_s))
