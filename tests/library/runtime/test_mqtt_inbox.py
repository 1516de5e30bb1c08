"""What a reader is given of what has arrived."""

import asyncio

from skyway.contracts.topics import ACKS, CLOCK, STATE, STATION_STATE
from skyway.runtime.mqtt_inbox import BATCH_SIZE, Inbox

CLOCK_JSON = (
    b'{"message_id": "m", "sent_at": "2026-01-01T00:00:00Z", "fleet_at": "2026-01-01T00:00:00Z",'
    b' "wall_at": "2026-01-01T00:00:00Z", "rate": %d, "of a newer version": 1}'
)


async def test_all_that_waits_comes_at_once_and_in_order():
    inbox = Inbox((CLOCK,))
    for rate in (1, 2, 3):
        inbox.offer(CLOCK().name, CLOCK_JSON % rate, retained=False)

    batch = await anext(inbox.batches())

    assert [received.message.rate for received in batch] == [1, 2, 3]


async def test_a_batch_is_never_longer_than_agreed():
    inbox = Inbox((CLOCK,))
    for _ in range(BATCH_SIZE + 1):
        inbox.offer(CLOCK().name, CLOCK_JSON % 1, retained=False)
    batches = inbox.batches()

    sizes = [len(await anext(batches)), len(await anext(batches))]

    assert sizes == [BATCH_SIZE, 1]


async def test_a_reader_waits_for_what_comes_later():
    inbox = Inbox((CLOCK,))
    waiting = asyncio.ensure_future(anext(inbox.batches()))
    await asyncio.sleep(0)
    assert not waiting.done()

    inbox.offer(CLOCK().name, CLOCK_JSON % 1, retained=True)

    [received] = await waiting
    assert received.retained


async def test_an_unreadable_message_is_told_once_and_dropped(caplog):
    inbox = Inbox((CLOCK,))
    for payload in (b"{", b"{}", CLOCK_JSON % 0, CLOCK_JSON % 5):
        inbox.offer(CLOCK().name, payload, retained=False)

    [received] = await anext(inbox.batches())

    assert received.message.rate == 5
    assert len(caplog.records) == 1


async def test_only_what_is_subscribed_is_kept():
    inbox = Inbox((ACKS("p", "d"), CLOCK))
    inbox.offer(ACKS("p", "other").name, b"{}", retained=False)
    inbox.offer("somewhere/else", b"{}", retained=False)
    inbox.offer(CLOCK().name, CLOCK_JSON % 7, retained=False)

    [received] = await anext(inbox.batches())

    assert received.topic is CLOCK


def test_the_filters_name_topics_whole_or_one_address():
    inbox = Inbox((STATE, ACKS("p", "d")))

    assert inbox.filters == {"skyway/v1/+/+/state": 1, "skyway/v1/p/d/acks": 1}


async def test_a_stations_state_is_not_a_drones(caplog):
    inbox = Inbox((STATE, CLOCK))
    inbox.offer(STATION_STATE("s").name, b"{}", retained=False)
    inbox.offer(CLOCK().name, CLOCK_JSON % 7, retained=False)

    [received] = await anext(inbox.batches())

    assert received.topic is CLOCK
    assert caplog.records == []
