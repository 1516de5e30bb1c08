"""Sending the stream of requests at its own pace, however slow the answers are."""

import asyncio
import json
import time
import uuid
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from http import HTTPStatus
from itertools import cycle
from typing import Final

import aiohttp
from skyway_lab.benchmarks.load.city import DueRequest
from skyway_lab.benchmarks.load.world import Customer, World

from skyway.ids import DeliveryId

_CONNECTIONS: Final = 32
_TIMEOUT_S: Final = 30.0
#: Servers close what was silent for 5 s; a request must not meet that.
_KEPT_S: Final = 4.0


@dataclass(slots=True)
class Sent:
    """What came of the requests; moments are monotonic seconds."""

    asked_at: dict[DeliveryId, float] = field(default_factory=dict)
    #: Seconds from sending a request to its 202.
    answered_within_s: list[float] = field(default_factory=list)
    #: Answers that were not 202, by status or by what broke.
    refused: Counter[str] = field(default_factory=Counter)
    #: Seconds by which requests were sent later than they were due: our own lateness.
    late_s: list[float] = field(default_factory=list)


async def send(
    url: str, world: World, requests: Iterable[DueRequest], *, sent: Sent | None = None
) -> Sent:
    """Send each request when it is due, and wait for all answers; they are noted in `sent`."""
    sent = sent or Sent()
    # Customers share the machine with what is measured: aiohttp takes a third of httpx's time.
    connector = aiohttp.TCPConnector(limit=_CONNECTIONS, keepalive_timeout=_KEPT_S)
    timeout = aiohttp.ClientTimeout(total=_TIMEOUT_S)
    customers = cycle(world.customers)
    started_s = time.monotonic()
    async with (
        aiohttp.ClientSession(url, connector=connector, timeout=timeout) as client,
        asyncio.TaskGroup() as group,
    ):
        for request in requests:
            due_s = started_s + request.at_s
            await asyncio.sleep(max(0.0, due_s - time.monotonic()))
            sent.late_s.append(time.monotonic() - due_s)
            group.create_task(_post(client, sent, request, next(customers)))
    return sent


async def _post(
    client: aiohttp.ClientSession, sent: Sent, request: DueRequest, customer: Customer
) -> None:
    headers = {
        "Authorization": f"Bearer {customer.key}",
        "Content-Type": "application/json",
        "Idempotency-Key": uuid.uuid4().hex,
    }
    asked_s = time.monotonic()
    try:
        async with client.post("/v1/deliveries", data=request.body, headers=headers) as answer:
            body = await answer.read()
    except (aiohttp.ClientError, TimeoutError) as error:
        sent.refused[type(error).__name__] += 1
        return
    if answer.status != HTTPStatus.ACCEPTED:
        sent.refused[str(answer.status)] += 1
        return
    sent.answered_within_s.append(time.monotonic() - asked_s)
    sent.asked_at[DeliveryId(json.loads(body)["delivery_id"])] = asked_s
