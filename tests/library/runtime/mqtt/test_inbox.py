"""The batches of messages that a reader gets."""

import asyncio
import json
from typing import Any

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import ACKS, CLOCK, STATE, STATION_STATE, TELEMETRY
from skyway.runtime.metrics import COUNTERS
from skyway.runtime.mqtt.inbox import BATCH_SIZE, MOST_LIGHT, Arrival, Inbox, ReadAgain

CLOCK_JSON = (
    b'{"message_id": "m", "sent_at": "2026-01-01T00:00:00Z", "fleet_at": "2026-01-01T00:00:00Z",'
    b' "wall_at": "2026-01-01T00:00:00Z", "rate": %d, "of a newer version": 1}'
)


class OnlyOneDrone:
    """A `Doorkeeper` that reads the messages of drone 1 only."""

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        return ids[1] == "drn_1"

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        return False

    def is_proven(self, arrival: Arrival, read_again: ReadAgain) -> bool:
        return True

    def unreadable(self, *_: Any) -> None:
        raise AssertionError("nothing is read")


async def test_all_waiting_messages_come_in_one_batch_in_order():
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


async def test_a_reader_waits_for_later_messages():
    inbox = Inbox((CLOCK,))
    waiting = asyncio.ensure_future(anext(inbox.batches()))
    await asyncio.sleep(0)
    assert not waiting.done()

    inbox.offer(CLOCK().name, CLOCK_JSON % 1, retained=True)

    [received] = await waiting
    assert received.retained


async def test_messages_that_are_not_ours_are_dropped_as_they_arrive():
    inbox = Inbox((STATE,), OnlyOneDrone())
    for drone_id in ("drn_1", "drn_2"):
        inbox.offer(STATE("prv_1", drone_id).name, b"{", retained=False)

    assert inbox.waiting == 1


async def test_an_unreadable_message_is_logged_once_and_dropped(caplog):
    inbox = Inbox((CLOCK,))
    for payload in (b"{", b"{}", CLOCK_JSON % 0, CLOCK_JSON % 5):
        inbox.offer(CLOCK().name, payload, retained=False)

    [received] = await anext(inbox.batches())

    assert received.message.rate == 5
    assert len(caplog.records) == 1


async def test_only_subscribed_messages_are_kept():
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


def sample_json(seq: int) -> bytes:
    at = "2026-01-01T00:00:00Z"
    sample = {"message_id": "m", "sent_at": at, "at": at, "session": 1, "seq": seq, "soc": 0.5}
    return json.dumps({**sample, "position": [0, 0], "power_w": 1, "speed_mps": 1}).encode()


async def test_a_reader_that_is_stuck_loses_the_oldest_samples_and_nothing_else():
    shed = COUNTERS.value("skyway_mqtt_shed")
    inbox = Inbox((TELEMETRY, CLOCK))
    for seq in range(MOST_LIGHT + 1):
        if seq % 1000 == 0:
            inbox.offer(CLOCK().name, CLOCK_JSON % (1 + seq), retained=False)
        inbox.offer(TELEMETRY("p", "d").name, sample_json(seq), retained=False)
    inbox.offer(CLOCK().name, CLOCK_JSON % 99_999, retained=False)

    received: list[Any] = []
    async for batch in inbox.batches():
        received.extend(one.message for one in batch)
        if getattr(received[-1], "rate", 0) == 99_999:
            break

    seqs = [one.seq for one in received if isinstance(one, Telemetry)]
    rates = [one.rate for one in received if not isinstance(one, Telemetry)]
    assert seqs == list(range(MOST_LIGHT // 2, MOST_LIGHT + 1))
    assert rates == [1 + 1000 * number for number in range(MOST_LIGHT // 1000 + 1)] + [99_999]
    assert COUNTERS.value("skyway_mqtt_shed") == shed + MOST_LIGHT // 2


async def test_samples_that_were_read_make_room_for_others():
    shed = COUNTERS.value("skyway_mqtt_shed")
    inbox = Inbox((TELEMETRY,))
    batches = inbox.batches()
    for _ in range(3):
        for _ in range(MOST_LIGHT - 1):
            inbox.offer(TELEMETRY("p", "d").name, b"{", retained=False)
        inbox.offer(TELEMETRY("p", "d").name, sample_json(7), retained=False)
        await anext(batches)

    assert COUNTERS.value("skyway_mqtt_shed") == shed
