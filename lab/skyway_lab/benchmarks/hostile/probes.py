"""What honest people do again and again, and how long it takes."""

import asyncio
import json
import statistics
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final

import aiohttp
from skyway_lab.benchmarks.chaos.cast import Cast

from skyway.contracts.delivery_event import DeliveryEventType

_EVERY_S: Final = 0.5
_ANSWER_WITHIN_S: Final = 30.0
#: A short phase lasts until each thing was done once, but not longer than this.
_FIRST_ROUND_WITHIN_S: Final = 60.0
#: Wall seconds between two tries of a key that was revoked.
_TRY_KEY_EVERY_S: Final = 0.05

#: Wall seconds of each thing that was done.
Seconds = Mapping[str, Sequence[float]]


@dataclass(frozen=True, slots=True)
class Probes:
    """How long each thing took that was done so far, and whether each was done once."""

    found: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    first_round: asyncio.Event = field(default_factory=asyncio.Event)

    async def finish_first_round(self) -> None:
        """Wait until each thing was done once; without an error when that takes too long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_FIRST_ROUND_WITHIN_S):
                await self.first_round.wait()


@asynccontextmanager
async def probing(cast: Cast) -> AsyncIterator[Probes]:
    """Ask for quotes and lists, and revoke keys, while the block lasts."""
    probes = Probes()
    asking = asyncio.create_task(_ask_again_and_again(cast, probes))
    try:
        yield probes
    finally:
        asking.cancel()
        with suppress(asyncio.CancelledError):
            await asking


async def _ask_again_and_again(cast: Cast, probes: Probes) -> None:
    found = probes.found
    url, operator = cast.running.customers_url, cast.operator_key
    customer = next(iter(cast.webhook_ids))
    bodies = cast.city.requests(rate_per_s=10.0, seconds=1e6, seed=cast.trial.seed + 2)
    timeout = aiohttp.ClientTimeout(total=_ANSWER_WITHIN_S)
    async with aiohttp.ClientSession(timeout=timeout) as client:

        async def timed(what: str, method: str, path: str, key: str, body: Any = None) -> Any:
            started_s = time.perf_counter()
            headers = {"Authorization": f"Bearer {key}"}
            async with client.request(method, url + path, json=body, headers=headers) as answer:
                answer.raise_for_status()
                content = await answer.read()
            found[what].append(time.perf_counter() - started_s)
            return json.loads(content) if content else None

        while True:
            await timed("quote", "POST", "/v1/quotes", customer, json.loads(next(bodies).body))
            await timed("list of deliveries", "GET", "/v1/deliveries", customer)
            await timed("list of alarms", "GET", "/v1/alarms", operator)
            await timed("list of missions", "GET", "/v1/missions", operator)
            subject = {"role": "customer", "subject_id": "honest"}
            issued = await timed("new key", "POST", "/v1/keys", operator, subject)
            await _use(client, url, issued["key"])
            started_s = time.perf_counter()
            await timed("revoke", "DELETE", f"/v1/keys/{issued['key_id']}", operator)
            await _until_refused(client, url, issued["key"])
            found["revoked key refused"].append(time.perf_counter() - started_s)
            probes.first_round.set()
            await asyncio.sleep(_EVERY_S)


async def _until_refused(client: aiohttp.ClientSession, url: str, key: str) -> None:
    while await _use(client, url, key) != HTTPStatus.UNAUTHORIZED:  # noqa: ASYNC110 - over HTTP
        await asyncio.sleep(_TRY_KEY_EVERY_S)


async def _use(client: aiohttp.ClientSession, url: str, key: str) -> int:
    headers = {"Authorization": f"Bearer {key}"}
    async with client.get(f"{url}/v1/clock", headers=headers) as answer:
        return answer.status


def deliveries_between(cast: Cast, from_s: float, until_s: float) -> dict[str, list[float]]:
    """From the answer to a request until it was planned, by stream and by webhook.

    Of the requests that were accepted between these moments, monotonic seconds.
    """
    found: dict[str, list[float]] = {"planned": [], "planned, by webhook": []}
    for delivery_id, accepted in cast.customers.requests.accepted.items():
        if not from_s <= accepted.at_s < until_s:
            continue
        for what, received in (
            ("planned", cast.streams.received.get(delivery_id, ())),
            ("planned, by webhook", cast.webhooks.received.get(delivery_id, ())),
        ):
            moments = [
                each.at_s for each in received if each.event.type == DeliveryEventType.PLANNED
            ]
            if moments:
                found[what].append(min(moments) - accepted.at_s)
    return found


def middle(seconds: Sequence[float]) -> float | None:
    """The median; None of nothing."""
    return statistics.median(seconds) if seconds else None
