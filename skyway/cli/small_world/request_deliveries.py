"""Requests deliveries in the small world, one every few seconds, and never many at a time."""

import asyncio
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Final, Never

import httpx

from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.drawn_request import RequestDraw
from skyway.errors import SkywayError

#: Seconds of wall time between two requests.
REQUEST_EVERY_S: Final = 4.0

#: Deliveries that are not over; while there are as many, nothing is requested.
MOST_OPEN: Final = 10

_OVER: Final = frozenset({"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})


class Customers:
    """The customers of the small world, who take turns; `say` gets each trouble once."""

    def __init__(
        self,
        api: GatewayApi,
        keys: Sequence[str],
        draw: RequestDraw,
        *,
        say: Callable[[str], None],
    ) -> None:
        self._api = api
        self._keys = keys
        self._draw = draw
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
            if len(self._open) < MOST_OPEN:
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

    async def _request(self) -> None:
        key = self._keys[self._turn % len(self._keys)]
        clock = await self._api.call("GET", "/v1/clock", key=key)
        body = self._draw.draw(datetime.fromisoformat(clock["now"]))
        created = await self._api.call("POST", "/v1/deliveries", key=key, body=body)
        self._open[created["delivery_id"]] = key
        self._turn += 1
