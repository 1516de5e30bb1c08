"""Customers who request deliveries until each is accepted, and follow them to their end."""

import asyncio
import time
import uuid
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import httpx
from skyway_lab.benchmarks.load.city import DueRequest
from skyway_lab.benchmarks.load.world import Customer

from skyway.errors import SkywayError

#: A customer tries again after this, and gives an attempt up after that; wall seconds.
_AGAIN_AFTER_S: Final = 0.5
_ATTEMPT_S: Final = 10.0
_ENDED: Final = ("COMPLETED", "PARTIALLY_COMPLETED", "REJECTED", "FAILED", "CANCELLED")


@dataclass(slots=True)
class Accepted:
    """The deliveries that were answered 202, and when; moments are monotonic seconds."""

    at_s: dict[str, float] = field(default_factory=dict)

    def longest_gap_s(self, *, after_s: float) -> float:
        """The longest time without a 202 that began after a moment, or held it."""
        moments = sorted(self.at_s.values())
        gaps = pairwise(moments)
        return max((end - max(begin, after_s) for begin, end in gaps if end > after_s), default=0.0)


async def request_all(
    url: str, requests: Sequence[DueRequest], customers: Sequence[Customer], accepted: Accepted
) -> None:
    """Request deliveries, each when it is due, in the name of all customers in turn."""
    started_s = time.monotonic()
    async with httpx.AsyncClient(base_url=url) as client, asyncio.TaskGroup() as group:
        for number, request in enumerate(requests):
            key = customers[number % len(customers)].key
            due_s = started_s + request.at_s
            group.create_task(_request(client, accepted, request.body, key, due_s=due_s))


async def _request(
    client: httpx.AsyncClient, accepted: Accepted, body: bytes, key: str, *, due_s: float
) -> None:
    """Request a delivery as customers should: until it is accepted, with the same key."""
    await asyncio.sleep(max(0.0, due_s - time.monotonic()))
    headers = {"Authorization": f"Bearer {key}", "Content-Type": "application/json"}
    headers["Idempotency-Key"] = uuid.uuid4().hex
    while True:
        with suppress(httpx.HTTPError):
            answer = await client.post(
                "/v1/deliveries", content=body, headers=headers, timeout=_ATTEMPT_S
            )
            if answer.status_code == httpx.codes.ACCEPTED:
                accepted.at_s[answer.json()["delivery_id"]] = time.monotonic()
                return
            if answer.status_code < httpx.codes.INTERNAL_SERVER_ERROR:
                raise SkywayError(f"refused: {answer.text}")
        await asyncio.sleep(_AGAIN_AFTER_S)


async def states_at_end(
    url: str, key: str, delivery_ids: Sequence[str], *, within_s: float
) -> dict[str, str]:
    """The state of each delivery once all have ended, or after a long time.

    A delivery that is not found has the status of the answer instead.
    """
    states = dict.fromkeys(delivery_ids, "")
    ends_s = time.monotonic() + within_s
    async with httpx.AsyncClient(
        base_url=url, headers={"Authorization": f"Bearer {key}"}
    ) as client:
        while time.monotonic() < ends_s and not have_ended(states):
            for each in [one for one, state in states.items() if state not in _ENDED]:
                with suppress(httpx.HTTPError):
                    answer = await client.get(f"/v1/deliveries/{each}", timeout=_ATTEMPT_S)
                    is_there = answer.status_code == httpx.codes.OK
                    states[each] = answer.json()["state"] if is_there else f"{answer.status_code}"
            await asyncio.sleep(1.0)
    return states


def have_ended(states: dict[str, str]) -> bool:
    """Whether all deliveries are there, and over."""
    return all(state in _ENDED for state in states.values())
