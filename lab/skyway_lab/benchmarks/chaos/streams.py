"""Follows every delivery by server-sent events, and goes on after each break where it was."""

import asyncio
import time
from collections import defaultdict
from contextlib import suppress
from http import HTTPStatus
from typing import Final

import aiohttp
from skyway_lab.benchmarks.chaos.evidence import Received
from skyway_lab.benchmarks.load.follow import LAST_EVENTS

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.ids import DeliveryId

_AGAIN_AFTER_S: Final = 0.7
#: The gateway sends something every 15 s.
_SILENT_S: Final = 40.0


class Streams:
    """The events of each delivery in the order of their arrival."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._following: dict[DeliveryId, asyncio.Task[None]] = {}
        self.received: dict[DeliveryId, list[Received]] = defaultdict(list)

    def follow(self, client: aiohttp.ClientSession, delivery_id: DeliveryId, key: str) -> None:
        """Follow a delivery to its end."""
        self._following[delivery_id] = asyncio.create_task(self._follow(client, delivery_id, key))

    def has_ended(self, delivery_id: DeliveryId) -> bool:
        """Whether the last event of a delivery has arrived."""
        events = self.received[delivery_id]
        return bool(events) and events[-1].event.type in LAST_EVENTS

    async def stop(self) -> None:
        """Follow nothing any more."""
        for following in self._following.values():
            following.cancel()
        for following in self._following.values():
            with suppress(asyncio.CancelledError):
                await following

    async def _follow(
        self, client: aiohttp.ClientSession, delivery_id: DeliveryId, key: str
    ) -> None:
        while True:
            with suppress(aiohttp.ClientError, TimeoutError, ValueError):
                if await self._follow_once(client, delivery_id, key):
                    return
            await asyncio.sleep(_AGAIN_AFTER_S)

    async def _follow_once(
        self, client: aiohttp.ClientSession, delivery_id: DeliveryId, key: str
    ) -> bool:
        """Follow until the stream ends or breaks; whether nothing will come any more."""
        events = self.received[delivery_id]
        headers = {"Authorization": f"Bearer {key}", "Accept": "text/event-stream"}
        if events:
            headers["Last-Event-ID"] = str(events[-1].event.sequence)
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=5.0, sock_read=_SILENT_S)
        url = f"{self._url}/v1/deliveries/{delivery_id}/events"
        async with client.get(url, headers=headers, timeout=timeout) as answer:
            if answer.status == HTTPStatus.NO_CONTENT:
                return True
            if answer.status != HTTPStatus.OK:
                return False
            async for line in answer.content:
                if line.startswith(b"data: "):
                    event = DeliveryEvent.model_validate_json(line.removeprefix(b"data: "))
                    events.append(Received(event, time.monotonic()))
        return self.has_ended(delivery_id)
