"""Before the first fault and after the last: waits until all ends, and collects the evidence."""

import asyncio
import time
from typing import Final

from skyway_lab.benchmarks.chaos.cast import Cast
from skyway_lab.benchmarks.chaos.evidence import Evidence
from skyway_lab.benchmarks.chaos.final_answers import OUT_OF_CONTACT, FinalQuestions

from skyway.errors import SkywayError
from skyway.ids import DeliveryId

#: A drone shows its state every 30 s: if nothing is learned from it for longer, people must look.
_ASKED_FOR_S: Final = 45.0
#: Wall seconds within which the first requests must have ended.
_WARM_WITHIN_S: Final = 90.0


async def warmed_up(cast: Cast) -> None:
    """The first requests compile and fill caches: wait until all of them have ended."""
    first = cast.city.requests(rate_per_s=3.0, seconds=2.0, seed=cast.trial.seed + 1)
    await cast.customers.request_all(cast.client, first)
    try:
        async with asyncio.timeout(_WARM_WITHIN_S):
            await cast.customers.all_answered(within_s=_WARM_WITHIN_S)
            while not_ended(cast):  # noqa: ASYNC110 - other processes end them
                await asyncio.sleep(0.1)
    except TimeoutError as error:
        raise SkywayError("the system was not warm in time") from error


async def settled(cast: Cast) -> float:
    """Wait until everything has ended, for a bounded time; how long it took, wall seconds."""
    started_s = time.monotonic()
    ends_s = started_s + cast.trial.quiet_s
    await cast.customers.all_answered(within_s=cast.trial.quiet_s)
    out_of_contact_since_s = time.monotonic()
    while (left := not_ended(cast)) and time.monotonic() < ends_s:
        if not await _are_out_of_contact(cast, left):
            out_of_contact_since_s = time.monotonic()
        elif time.monotonic() - out_of_contact_since_s > _ASKED_FOR_S:
            break
        await asyncio.sleep(0.5)
    return time.monotonic() - started_s


def not_ended(cast: Cast) -> list[DeliveryId]:
    """The deliveries whose last event has not arrived by stream and by webhook."""
    return [
        delivery_id
        for delivery_id in cast.customers.requests.accepted
        if not (cast.streams.has_ended(delivery_id) and cast.webhooks.has_ended(delivery_id))
    ]


async def _are_out_of_contact(cast: Cast, deliveries: list[DeliveryId]) -> bool:
    """Whether all of these wait for a drone that does not report."""
    accepted = cast.customers.requests.accepted
    async with FinalQuestions.client(cast.running.system.urls["gateway"]) as client:
        questions = FinalQuestions(client, operator_key=cast.operator_key)
        answers = await questions.deliveries(accepted[each] for each in deliveries)
    return all(answer.activity == OUT_OF_CONTACT for answer in answers.values())


async def evidence_of(cast: Cast) -> Evidence:
    """All that is known from outside."""
    accepted = cast.customers.requests.accepted
    async with FinalQuestions.client(cast.running.system.urls["gateway"]) as client:
        questions = FinalQuestions(client, operator_key=cast.operator_key)
        answers = await questions.deliveries(accepted.values())
        awaited = await questions.awaited(answers)
        retried = await questions.retried(cast.webhook_ids)
    cast.journals.read()
    return Evidence(
        accepted={delivery_id: each.requested for delivery_id, each in accepted.items()},
        streams=dict(cast.streams.received),
        webhooks=dict(cast.webhooks.received),
        journals=cast.journals.custody_steps(),
        answers=answers,
        awaited=awaited,
        forgetful=frozenset(cast.journals.lost),
        retried=retried,
    )
