"""Customers: they request deliveries, ask again until they are answered, and cancel a few."""

import asyncio
import json
import random
import time
import uuid
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from itertools import cycle
from typing import Final

import aiohttp
from skyway_lab.benchmarks.chaos.evidence import Requested
from skyway_lab.benchmarks.chaos.streams import Streams
from skyway_lab.benchmarks.load.city import DueRequest
from skyway_lab.benchmarks.load.world import Customer

from skyway.ids import DeliveryId, PackageId, StationId

#: Wall seconds: how long a customer waits for an answer, and until asking again.
_ANSWER_WITHIN_S: Final = 10.0
_AGAIN_AFTER_S: Final = 0.5
#: The share of deliveries that are cancelled, and after how many wall seconds.
_CANCELLED: Final = 0.06
_CANCELLED_AFTER_S: Final = (0.5, 15.0)


@dataclass(frozen=True, slots=True)
class Accepted:
    """A request that was answered 202; `at_s` is monotonic."""

    delivery_id: DeliveryId
    customer: Customer
    requested: Requested
    at_s: float


@dataclass(slots=True)
class Requests:
    """What came of all requests."""

    accepted: dict[DeliveryId, Accepted] = field(default_factory=dict)
    #: Answers and errors by the moment's fault: (status or error, fault).
    answers: Counter[tuple[str, str]] = field(default_factory=Counter)
    #: Requests that nothing answered in the end, and why not.
    unanswered: list[str] = field(default_factory=list)


class Customers:
    """All customers; they reach the gateway over their wire.

    `fault` names the present fault, for counting answers.
    """

    def __init__(
        self, url: str, people: Sequence[Customer], streams: Streams, *, chance: random.Random
    ) -> None:
        self._url = url
        self._people = cycle(people)
        self._streams = streams
        self._chance = chance
        self._asking: set[asyncio.Task[None]] = set()
        self.requests = Requests()
        self.fault = "none"

    async def request_all(
        self, client: aiohttp.ClientSession, stream: Iterable[DueRequest]
    ) -> None:
        """Send each request when it is due, however slow the answers are."""
        started_s = time.monotonic()
        for each in stream:
            await asyncio.sleep(max(0.0, started_s + each.at_s - time.monotonic()))
            self.request(client, each.body)

    def request(self, client: aiohttp.ClientSession, body: bytes) -> None:
        """Send a request, and again until it is answered."""
        asking = asyncio.create_task(self._ask(client, body, next(self._people)))
        self._asking.add(asking)
        asking.add_done_callback(self._asking.discard)

    async def all_answered(self, *, within_s: float) -> None:
        """Wait until every request is answered; give up those that are not."""
        if self._asking:
            _, left = await asyncio.wait(set(self._asking), timeout=within_s)
            for asking in left:
                asking.cancel()
                with suppress(asyncio.CancelledError):
                    await asking
                self.requests.unanswered.append("a POST was not answered in the quiet time")

    async def _ask(self, client: aiohttp.ClientSession, body: bytes, customer: Customer) -> None:
        headers = {
            "Authorization": f"Bearer {customer.key}",
            "Content-Type": "application/json",
            "Idempotency-Key": uuid.uuid4().hex,
        }
        while True:
            status, answer = await self._post(client, "/v1/deliveries", body, headers)
            self.requests.answers[status, self.fault] += 1
            if status == str(int(HTTPStatus.ACCEPTED)):
                delivery_id = DeliveryId(json.loads(answer)["delivery_id"])
                await self._is_accepted(client, delivery_id, body, customer, headers)
                return
            if status.startswith("4"):
                self.requests.unanswered.append(f"a POST was answered {status}: {answer!r:.300}")
                return
            await asyncio.sleep(_AGAIN_AFTER_S)

    async def _is_accepted(
        self,
        client: aiohttp.ClientSession,
        delivery_id: DeliveryId,
        body: bytes,
        customer: Customer,
        headers: dict[str, str],
    ) -> None:
        requested = Requested(
            {
                PackageId(package["package_id"]): StationId(package["destination"]["station_id"])
                for package in json.loads(body)["packages"]
            }
        )
        accepted = Accepted(delivery_id, customer, requested, time.monotonic())
        self.requests.accepted[delivery_id] = accepted
        self._streams.follow(client, delivery_id, customer.key)
        if self._chance.random() < _CANCELLED:
            await asyncio.sleep(self._chance.uniform(*_CANCELLED_AFTER_S))
            await self._post(
                client,
                f"/v1/deliveries/{delivery_id}/cancel",
                b'{"reason": "chaos"}',
                headers | {"Idempotency-Key": uuid.uuid4().hex},
            )

    async def _post(
        self, client: aiohttp.ClientSession, path: str, body: bytes, headers: dict[str, str]
    ) -> tuple[str, bytes]:
        """The status and the body, or the name of what broke."""
        timeout = aiohttp.ClientTimeout(total=_ANSWER_WITHIN_S)
        try:
            async with client.post(
                self._url + path, data=body, headers=headers, timeout=timeout
            ) as answer:
                return str(answer.status), await answer.read()
        except (aiohttp.ClientError, TimeoutError) as error:
            return type(error).__name__, b""
