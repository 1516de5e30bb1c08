"""Two deliveries of one drone: the second is booked behind the first, while the drone is busy."""

import asyncio
from typing import Any

from skyway.cli.demo.flown import Flown
from skyway.cli.demo.screen import DemoScreen
from skyway.cli.demo.world import CHAINED_REQUESTS, World, delivery_request
from skyway.cli.gateway import GatewayApi
from skyway.errors import SkywayError

_DECIDED = frozenset({"PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS", "COMPLETED"})
_LOST = frozenset({"PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})


class Chain:
    """The deliveries of a provider that has one drone, and what was shown of them."""

    def __init__(self, api: GatewayApi, world: World, screen: DemoScreen) -> None:
        self._api, self._world, self._screen = api, world, screen
        self._deliveries: list[dict[str, Any]] = []

    @property
    def has_ended(self) -> bool:
        """Whether both packages are delivered."""
        return all(each["state"] == "COMPLETED" for each in self._deliveries)

    async def request(self) -> None:
        """Request both deliveries; each is planned before the next one is requested."""
        for pickup, packages in CHAINED_REQUESTS:
            body = delivery_request(
                pickup, packages, objective="fastest", pinned=self._world.courier_id
            )
            created = await self._call("POST", "/v1/deliveries", body)
            delivery = await self._read(created["delivery_id"])
            while delivery["state"] not in _DECIDED:
                await asyncio.sleep(0.1)  # another process decides: no event can be awaited
                delivery = await self._read(created["delivery_id"])
            self._deliveries.append(delivery)
            self._screen.chained(delivery, number=len(self._deliveries))

    async def look(self) -> None:
        """Show what has changed since the last look."""
        for index, before in enumerate(self._deliveries):
            if before["state"] == "COMPLETED":
                continue
            delivery = self._deliveries[index] = await self._read(before["delivery_id"])
            if delivery["state"] != before["state"]:
                self._screen.chained(delivery, number=index + 1)

    def compare(self, flown: Flown) -> None:
        """Show the plans beside what was flown."""
        for delivery in self._deliveries:
            self._screen.compare(delivery, flown)

    async def _read(self, delivery_id: str) -> dict[str, Any]:
        """The delivery.

        Raises
        ------
        SkywayError
            The delivery was not served.
        """
        delivery = await self._call("GET", f"/v1/deliveries/{delivery_id}", None)
        if delivery["state"] in _LOST:
            raise SkywayError(
                f"delivery {delivery_id} ended {delivery['state']}: {delivery['reasons']}"
            )
        return delivery

    async def _call(self, method: str, path: str, body: object) -> dict[str, Any]:
        key = self._world.courier_customer_key
        answer: dict[str, Any] = await self._api.call(method, path, key=key, body=body)
        return answer
