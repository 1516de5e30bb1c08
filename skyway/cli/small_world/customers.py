"""The shops' requests: one delivery every few seconds, while enough drones are idle."""

import asyncio
from collections.abc import Callable, Mapping
from datetime import datetime
from random import Random
from typing import Final, Never

import httpx

from skyway.cli.demo.fleets import NETWORK_ID
from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.requests import RequestDraw
from skyway.cli.small_world.shops import Shop, recipient
from skyway.errors import SkywayError

#: Seconds of wall time between two requests.
REQUEST_EVERY_S: Final = 4.0

#: Deliveries that are not over; while there are as many, nothing is requested.
MOST_OPEN: Final = 12

#: While fewer drones are idle, nothing is requested: they are left to those who try the demo.
LEAST_IDLE: Final = 5

_OVER: Final = frozenset({"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})


class Customers:
    """The shops by their keys, which take turns; `say` gets each trouble once."""

    def __init__(
        self,
        api: GatewayApi,
        shops: Mapping[str, Shop],
        draw: RequestDraw,
        *,
        chance: Random,
        operator_key: str,
        say: Callable[[str], None],
    ) -> None:
        self._api = api
        self._shops = shops
        self._keys = tuple(shops)
        self._chance = chance
        self._draw = draw
        self._operator_key = operator_key
        self._say = say
        self._turn = 0
        self._said = ""
        #: The key of each delivery that is not over.
        self._open: dict[str, str] = {}

    async def run(self) -> Never:
        """Go on with what an earlier start requested, and request more; this never returns."""
        while True:
            await self.step()
            await asyncio.sleep(REQUEST_EVERY_S)

    async def step(self) -> None:
        """Request one delivery, unless there are enough; trouble is left to the next step."""
        try:
            await self._look()
            if len(self._open) < MOST_OPEN and await self._idle_drones() >= LEAST_IDLE:
                await self._request()
        except (SkywayError, httpx.HTTPError) as trouble:
            if str(trouble) != self._said:
                self._said = str(trouble)
                self._say(f"no delivery is requested now: {trouble}")

    async def _look(self) -> None:
        """See which deliveries are over; the first look finds those of an earlier start."""
        if self._turn == 0:
            for key in self._keys:
                page = await self._api.call("GET", "/v1/deliveries?limit=50", key=key)
                self._open |= {each["delivery_id"]: key for each in page["items"]}
        for delivery_id, key in list(self._open.items()):
            delivery = await self._api.call("GET", f"/v1/deliveries/{delivery_id}", key=key)
            if delivery["state"] in _OVER:
                del self._open[delivery_id]

    async def _idle_drones(self) -> int:
        path = f"/v1/networks/{NETWORK_ID}/status"
        status = await self._api.call("GET", path, key=self._operator_key)
        return sum(each["idle"] for each in status["models"])

    async def _request(self) -> None:
        key = self._keys[self._turn % len(self._keys)]
        clock = await self._api.call("GET", "/v1/clock", key=key)
        body = self._draw.draw(datetime.fromisoformat(clock["now"]), self._shops[key])
        body["recipient"] = recipient(self._chance)
        created = await self._api.call("POST", "/v1/deliveries", key=key, body=body)
        self._open[created["delivery_id"]] = key
        self._turn += 1
