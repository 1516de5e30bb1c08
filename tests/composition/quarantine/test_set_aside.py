"""Messages that cannot be taken are kept within bounds, and the others go on."""

from collections import Counter
from datetime import timedelta
from typing import Any

import pytest
from pydantic import ValidationError
from skyway_composition.quarantine import store
from skyway_composition.quarantine.set_aside import Quarantine

from skyway.contracts.topics import STATE
from skyway.ids import DroneId
from skyway.runtime.metrics import COUNTERS
from skyway.runtime.mqtt.inbox import Inbox
from skyway.runtime.mqtt.signature_check import SignatureCheck
from tests.unsigned_drones import unsigned_book


@pytest.fixture
def quarantine(composition: Any) -> Quarantine:
    kept: Quarantine = composition.parts.quarantine
    return kept


def unreadable(
    quarantine: Quarantine, payload: bytes, *, provider: str = "prv_1", drone: str = "drn_1"
) -> None:
    with pytest.raises(ValidationError) as raised:
        STATE.read(payload)
    quarantine.unreadable(STATE, (provider, drone), payload, raised.value)


async def inbox_of(composition: Any, quarantine: Quarantine) -> Inbox:
    """An inbox of drones that sign nothing."""
    book = unsigned_book(composition.clock)
    await book.look_up([DroneId("drn_1"), DroneId("drn_2")])
    return Inbox((STATE,), SignatureCheck(book, quarantine))


async def rows(composition: Any) -> Any:
    return await composition.rows("SELECT * FROM quarantine ORDER BY quarantine_id")


async def test_an_unreadable_message_is_kept_and_the_others_of_its_batch_are_read(
    composition: Any, drone: Any, quarantine: Quarantine
) -> None:
    inbox = await inbox_of(composition, quarantine)
    state = drone.state().message.model_dump_json().encode()
    inbox.offer(STATE("prv_1", "drn_1").name, b"{", retained=False)
    inbox.offer(STATE("prv_1", "drn_1").name, state, retained=False)

    (read,) = await anext(inbox.batches())
    await quarantine.step()

    assert read.payload == state
    (row,) = await rows(composition)
    assert (row.reason, row.topic) == ("UNREADABLE", "skyway/v1/prv_1/drn_1/state")
    assert (row.provider_id, row.drone_id, row.payload) == ("prv_1", "drn_1", b"{")
    assert await composition.broken() == []


async def test_only_the_begin_of_a_large_payload_is_kept(
    composition: Any, quarantine: Quarantine
) -> None:
    unreadable(quarantine, b'"' + b"x" * 1_000_000)
    await quarantine.step()

    (row,) = await rows(composition)
    assert (len(row.payload), row.size_bytes) == (8_192, 1_000_001)
    assert len(row.detail) <= 500
    assert await composition.broken() == []


async def test_a_repeated_message_is_kept_once(composition: Any, quarantine: Quarantine) -> None:
    for _ in range(3):
        unreadable(quarantine, b"{")
        await quarantine.step()
    unreadable(quarantine, b"{", drone="drn_2")
    await quarantine.step()

    assert [(row.drone_id, row.times) for row in await rows(composition)] == [
        ("drn_1", 3),
        ("drn_2", 1),
    ]


async def test_a_replica_that_set_it_aside_sooner_does_not_turn_time_back(
    composition: Any, quarantine: Quarantine
) -> None:
    unreadable(quarantine, b"{")
    await quarantine.step()
    composition.clock.advance(timedelta(minutes=-1))
    unreadable(quarantine, b"{")
    await quarantine.step()

    (row,) = await rows(composition)
    assert (row.times, row.first_ms) == (2, row.last_ms)
    assert await composition.broken() == []


async def test_a_sender_has_room_for_few_messages(composition: Any, quarantine: Quarantine) -> None:
    for number in range(50):
        unreadable(quarantine, b"{%d" % number)
        await quarantine.step()
        composition.clock.advance(timedelta(minutes=1))

    assert len(await rows(composition)) == store.MOST_OF_SENDER


async def test_a_provider_leaves_room_for_others(
    composition: Any, quarantine: Quarantine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "MOST_OF_PROVIDER", 7)
    monkeypatch.setattr(store, "MOST_ROWS", 9)
    for number in range(20):
        unreadable(quarantine, b"{%d" % number, drone=f"drn_{number}")
    await quarantine.step()
    for number in range(20):
        unreadable(quarantine, b"{%d" % number, provider="prv_2", drone=f"drn_{100 + number}")
    await quarantine.step()

    providers = [row.provider_id for row in await rows(composition)]
    assert providers == ["prv_1"] * 7 + ["prv_2"] * 2


async def test_while_the_database_is_away_few_messages_of_a_provider_wait(
    composition: Any, quarantine: Quarantine
) -> None:
    for number in range(60):
        unreadable(quarantine, b"{%d" % number, drone=f"drn_{number}")
    unreadable(quarantine, b"{", provider="prv_2", drone="drn_100")

    await quarantine.step()

    providers = Counter(row.provider_id for row in await rows(composition))
    assert providers == {"prv_1": 50, "prv_2": 1}


async def test_a_slowed_sender_is_only_counted(composition: Any, quarantine: Quarantine) -> None:
    before = COUNTERS.value("skyway_set_aside_not_kept")
    for number in range(60):
        unreadable(quarantine, b"{%d" % number)
    await quarantine.step()

    assert len(await rows(composition)) == 10
    assert COUNTERS.value("skyway_set_aside_not_kept") == before + 50


async def test_a_sender_that_is_put_out_is_not_read_and_raises_one_alarm(
    composition: Any, quarantine: Quarantine
) -> None:
    inbox = await inbox_of(composition, quarantine)
    for _ in range(2):
        for number in range(101):
            unreadable(quarantine, b"{%d" % number)
        await quarantine.step()
        assert quarantine.is_shut_out(("prv_1", "drn_1"))
        unread = COUNTERS.value("skyway_mqtt_unreadable", topic=STATE.template)
        inbox.offer(STATE("prv_1", "drn_1").name, b"{", retained=False)
        inbox.offer(STATE("prv_2", "drn_2").name, b"{", retained=False)
        inbox.offer(STATE("prv_2", "drn_2").name, STATE_JSON, retained=False)
        await anext(inbox.batches())
        assert COUNTERS.value("skyway_mqtt_unreadable", topic=STATE.template) == unread + 1

        composition.clock.advance(timedelta(minutes=10))
        assert not quarantine.is_shut_out(("prv_1", "drn_1"))

    (alarm,) = await composition.rows("SELECT * FROM alarms")
    assert (alarm.code, alarm.level) == ("SENDER_PUT_OUT", "URGENT")
    assert (alarm.provider_id, alarm.drone_id) == ("prv_1", "drn_1")


async def test_a_message_that_was_not_taken_may_have_been_an_answer(
    composition: Any, quarantine: Quarantine
) -> None:
    booked_at = composition.clock.now()
    composition.clock.advance(timedelta(seconds=1))

    unreadable(quarantine, b"{")

    now = composition.clock.now()
    assert not composition.listening.covers(DroneId("drn_1"), booked_at, now)
    assert composition.listening.covers(DroneId("drn_2"), booked_at, now)


async def test_messages_are_deleted_after_a_week(composition: Any, quarantine: Quarantine) -> None:
    unreadable(quarantine, b"{")
    await quarantine.step()
    composition.clock.advance(timedelta(days=4))
    unreadable(quarantine, b"[")
    await quarantine.step()
    composition.clock.advance(timedelta(days=4))

    await quarantine.step()

    assert [row.payload for row in await rows(composition)] == [b"["]


async def test_hostile_names_in_a_message_do_no_harm(
    composition: Any, quarantine: Quarantine
) -> None:
    unreadable(quarantine, b'{"a\\u0000\\u001b[2J": 1, "position": {"\\u0000": 1}}')
    await quarantine.step()

    (row,) = await rows(composition)
    assert row.detail.isprintable()


STATE_JSON = (
    b'{"message_id": "m", "sent_at": "2026-01-01T00:00:00Z", "at": "2026-01-01T00:00:00Z",'
    b' "session": 1, "seq": 1, "activity": "IDLE", "stream": 0, "last_instruction_seq": 0,'
    b' "last_event_seq": 0, "position": [0, 0], "soc": 1.0}'
)
