"""Messages of drones are read once it is proven who sent them."""

import asyncio
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.drones import DroneSignature
from skyway.contracts.topics import STATE, TELEMETRY, Topic
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.mqtt import signature_check
from skyway.runtime.mqtt.inbox import Arrival, Inbox
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.signing import key_book
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.signing.key_pair import PrivateKey

OLD, NEW = PrivateKey(b"1" * 32), PrivateKey(b"2" * 32)
ONE = STATE("prv_1", "drn_1")


@dataclass
class Registry:
    """A source of keys that counts what it is asked."""

    keys: dict[str, str | None] = field(default_factory=dict)
    unsigned: set[str] = field(default_factory=set)
    renewed: list[str] = field(default_factory=list)
    asked: list[tuple[str, ...]] = field(default_factory=list)
    is_away: bool = False
    meanwhile: Callable[[], None] | None = None

    def _of(self, drone_id: str) -> DroneSignature:
        key = self.keys.get(drone_id)
        is_signed = drone_id not in self.unsigned
        return DroneSignature(drone_id=DroneId(drone_id), is_signed=is_signed, public_key=key)

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        self.asked.append(tuple(drone_ids))
        if self.is_away:
            raise ServiceUnavailable("registry", "it is away")
        if self.meanwhile is not None:
            self.meanwhile()
            for _ in range(5):
                await asyncio.sleep(0)
        return [self._of(each) for each in drone_ids if each in {*self.keys, *self.unsigned}]

    async def changed(self) -> Sequence[DroneSignature]:
        if self.is_away:
            raise ServiceUnavailable("registry", "it is away")
        return [self._of(each) for each in self.renewed]


@dataclass
class Taken:
    """A reception that remembers what it took."""

    forged_payloads: list[bytes] = field(default_factory=list)
    postponed_ids: list[tuple[str, ...]] = field(default_factory=list)
    unreadable_payloads: list[bytes] = field(default_factory=list)
    foreign: set[str] = field(default_factory=set)

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        return ids[1] not in self.foreign

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        return ids[1] == "drn_out"

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: Exception
    ) -> None:
        self.unreadable_payloads.append(payload)

    def forged(self, arrival: Arrival) -> None:
        self.forged_payloads.append(arrival.payload)

    def postponed(self, ids: tuple[str, ...]) -> None:
        self.postponed_ids.append(ids)


class Door:
    """An inbox with its check."""

    def __init__(self) -> None:
        self.clock = ManualClock(datetime(2026, 3, 2, tzinfo=UTC))
        self.registry = Registry()
        self.taken = Taken()
        self.book = KeyBook(self.registry, self.clock)
        self.check = SignatureCheck(self.book, self.taken)
        self.inbox = Inbox((STATE, TELEMETRY), self.check)
        self._batches = self.inbox.batches()
        self._next: asyncio.Task[Any] | None = None

    def offer(self, payload: bytes, name: str = ONE.name) -> None:
        self.inbox.offer(name, payload, retained=False)

    async def read(self) -> list[bytes]:
        """What is read now, after the keys that are needed were looked up."""
        found: list[bytes] = []
        for _ in range(3):
            if self._next is None:
                self._next = asyncio.ensure_future(anext(self._batches))
            for _ in range(5):
                await asyncio.sleep(0)
            if self._next.done():
                found += [each.payload for each in self._next.result()]
                self._next = None
            await self.check.step()
        return found


def state(key: PrivateKey | None, seq: int = 1, name: str = ONE.name) -> bytes:
    payload = (
        b'{"message_id":"m","sent_at":"2026-03-02T00:00:00Z","session":1,"seq":%d,'
        b'"at":"2026-03-02T00:00:00Z","activity":"IDLE","stream":0,"last_instruction_seq":0,'
        b'"last_event_seq":0,"position":[0,0],"soc":1}' % seq
    )
    return payload if key is None else key.signed(name, payload)


@pytest.fixture
async def door() -> Door:
    return Door()


async def test_a_signed_message_is_read_after_its_key_was_looked_up(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    first, second = state(OLD), state(OLD, 2)
    door.offer(first)
    assert await door.read() == [first]
    door.offer(second)

    assert await door.read() == [second]
    assert door.registry.asked == [("drn_1",)]
    assert door.taken.postponed_ids == [("prv_1", "drn_1")]


async def test_a_message_that_comes_during_the_look_up_is_read_after_it(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.registry.meanwhile = lambda: door.offer(state(OLD, 2))
    door.offer(state(OLD))

    assert await door.read() == [state(OLD), state(OLD, 2)]
    assert len(door.registry.asked) == 1


async def test_a_message_is_dropped_if_the_look_up_shows_that_its_drone_is_not_ours(
    door: Door,
) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.registry.meanwhile = lambda: door.taken.foreign.add("drn_1")
    door.offer(state(OLD))

    assert await door.read() == []
    assert door.taken.forged_payloads == []


async def test_a_message_with_a_newer_key_that_comes_during_the_look_up_waits(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.registry.meanwhile = lambda: door.offer(state(NEW, 2))
    door.offer(state(OLD))
    assert await door.read() == [state(OLD)]

    door.registry.meanwhile = None
    door.registry.keys["drn_1"] = NEW.public_key
    door.clock.advance(timedelta(seconds=3))

    assert await door.read() == [state(NEW, 2)]
    assert door.taken.forged_payloads == []


async def test_a_drone_that_has_no_key_is_served_unsigned(door: Door) -> None:
    door.registry.unsigned.add("drn_1")
    door.offer(state(None))

    assert await door.read() == [state(None)]


@pytest.mark.parametrize(
    "payload",
    [
        state(None),
        state(NEW),
        state(OLD, name=STATE("prv_1", "drn_2").name),
        state(OLD, name=TELEMETRY("prv_1", "drn_1").name),
        state(OLD).replace(b"IDLE", b"DOWN"),
        b"{",
    ],
    ids=["stripped", "other key", "of another drone", "of another kind", "changed", "garbage"],
)
async def test_a_forged_message_is_rejected_unread(door: Door, payload: bytes) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(payload)
    door.offer(state(OLD))

    assert await door.read() == [state(OLD)]
    assert door.taken.forged_payloads == [payload]
    assert door.taken.unreadable_payloads == []


async def test_a_signed_message_that_cannot_be_read_is_the_drones_own(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    wrong = OLD.signed(ONE.name, b'{"seq":1}')
    door.offer(wrong)

    assert await door.read() == []
    assert door.taken.unreadable_payloads == [wrong]


async def test_a_new_key_is_looked_up_when_a_message_does_not_verify(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(state(OLD))
    await door.read()
    door.clock.advance(timedelta(seconds=3))
    door.registry.keys["drn_1"] = NEW.public_key
    door.offer(state(NEW, 2))

    assert await door.read() == [state(NEW, 2)]
    door.offer(state(OLD, 3))
    assert await door.read() == []
    assert door.taken.forged_payloads == []
    door.clock.advance(timedelta(seconds=3))
    assert await door.read() == []
    assert door.taken.forged_payloads == [state(OLD, 3)]


async def test_forgeries_cause_one_look_up_in_two_seconds(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    for number in range(101):
        door.offer(state(None, number))
        await door.read()

    assert (len(door.taken.forged_payloads), len(door.registry.asked)) == (81, 1)
    door.clock.advance(timedelta(seconds=3))
    await door.read()
    assert (len(door.taken.forged_payloads), len(door.registry.asked)) == (101, 2)


async def test_a_key_that_changes_just_after_it_was_looked_up_is_found(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(state(OLD))
    await door.read()
    door.registry.keys["drn_1"] = NEW.public_key
    door.offer(state(NEW, 2))
    assert await door.read() == []
    door.clock.advance(timedelta(seconds=3))

    assert await door.read() == [state(NEW, 2)]
    assert door.taken.forged_payloads == []


async def test_a_key_that_was_replaced_or_revoked_is_dropped(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(state(OLD))
    await door.read()
    door.registry.keys["drn_1"] = None
    door.registry.renewed.append("drn_1")

    await door.book.refresh()
    door.offer(state(OLD, 2))
    door.offer(state(None, 3))
    door.clock.advance(timedelta(seconds=3))

    assert await door.read() == []
    assert door.taken.forged_payloads == [state(OLD, 2), state(None, 3)]


async def test_a_drone_that_enrols_with_a_key_is_not_believed_without_it(door: Door) -> None:
    door.registry.unsigned.add("drn_1")
    door.offer(state(None))
    await door.read()
    door.registry.unsigned.clear()
    door.registry.keys["drn_1"] = NEW.public_key
    door.registry.renewed.append("drn_1")
    await door.book.refresh()
    door.offer(state(None, 2))
    door.offer(state(NEW, 3))

    assert await door.read() == [state(NEW, 3)]


@pytest.mark.parametrize("comes_by", ["look-up", "refresh"])
async def test_a_drone_that_signed_is_not_believed_unsigned_if_its_source_forgets(
    door: Door, comes_by: str
) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(state(OLD))
    await door.read()
    door.registry.keys.clear()
    door.registry.unsigned.add("drn_1")
    if comes_by == "refresh":
        door.registry.renewed.append("drn_1")
        await door.book.refresh()
    else:
        await door.book.look_up([DroneId("drn_1")])
    door.offer(state(None, 2))

    assert await door.read() == []


async def test_nothing_of_a_drone_that_is_not_registered_is_believed(door: Door) -> None:
    door.offer(state(None))

    assert await door.read() == []
    assert door.taken.forged_payloads == [state(None)]


async def test_messages_wait_while_the_registry_is_away(door: Door) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.registry.is_away = True
    door.offer(state(OLD))
    with pytest.raises(ServiceUnavailable):
        await door.read()
    door.registry.is_away = False

    assert await door.read() == [state(OLD)]


async def test_after_a_long_time_without_the_registry_all_keys_are_looked_up_anew(
    door: Door,
) -> None:
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(state(OLD))
    await door.read()
    door.registry.is_away = True
    with pytest.raises(ServiceUnavailable):
        await door.book.refresh()
    door.clock.advance(timedelta(minutes=2))
    door.registry.is_away = False
    door.registry.keys["drn_1"] = None
    await door.book.refresh()
    door.offer(state(OLD, 2))

    assert await door.read() == []


async def test_a_sender_that_is_put_out_is_not_even_checked(door: Door) -> None:
    door.offer(state(OLD), STATE("prv_1", "drn_out").name)

    assert await door.read() == []
    assert door.registry.asked == []


async def test_one_drone_takes_few_of_the_places_of_messages_that_wait(door: Door) -> None:
    door.registry.is_away = True
    for seq in range(100):
        door.offer(state(OLD, seq))
    with pytest.raises(ServiceUnavailable):
        await door.read()

    door.registry.is_away = False
    door.registry.keys["drn_1"] = OLD.public_key

    assert await door.read() == [state(OLD, seq) for seq in range(20)]


async def test_messages_that_wait_have_a_most_of_bytes(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signature_check, "_MOST_HELD_BYTES", 3 * len(state(OLD, 1)))
    door.registry.keys["drn_1"] = OLD.public_key
    for seq in range(1, 6):
        door.offer(state(OLD, seq))

    assert await door.read() == [state(OLD, seq) for seq in (1, 2, 3)]


async def test_a_message_that_is_too_large_does_not_wait(door: Door) -> None:
    large = OLD.signed(ONE.name, b'{"message_id":"' + b"x" * 100_000 + b'"}')
    door.registry.keys["drn_1"] = OLD.public_key
    door.offer(large)
    door.offer(state(OLD))

    assert await door.read() == [state(OLD)]
    assert door.taken.unreadable_payloads == []


async def test_a_drone_that_the_registry_leaves_out_is_not_believed() -> None:
    """It was removed: its messages are forgeries, with a signature and without one."""
    clock = ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC))
    book = KeyBook(Registry(keys={"drn_1": OLD.public_key}), clock)

    await book.look_up([DroneId("drn_1"), DroneId("drn_gone")])

    gone = STATE("prv_1", "drn_gone").name
    payloads = (state(None), state(OLD, name=gone))
    assert [book.judge("drn_gone", gone, each) for each in payloads] == ["FORGED"] * 2
    assert book.judge("drn_1", ONE.name, state(OLD)) == "PROVEN"


class SlowRegistry(Registry):
    """Its first answer about changed keys takes 40 s."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__(keys={"drn_1": OLD.public_key})
        self._clock = clock
        self._next_s = 40.0

    async def changed(self) -> Sequence[DroneSignature]:
        self._clock.advance(timedelta(seconds=self._next_s))
        self._next_s = 0.0
        return []


async def test_keys_that_may_have_changed_during_a_slow_answer_are_looked_up_anew() -> None:
    clock = ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC))
    book = KeyBook(SlowRegistry(clock), clock)
    await book.look_up([DroneId("drn_2")])
    await book.refresh()
    await book.look_up([DroneId("drn_1")])

    await book.refresh()

    assert book.judge("drn_1", ONE.name, state(OLD)) == "UNKNOWN"


async def test_the_keys_of_a_bounded_number_of_drones_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(key_book, "_MOST_KEPT", 2)
    names = [DroneId(f"drn_{number}") for number in range(1, 5)]
    clock = ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC))
    book = KeyBook(Registry(keys=dict.fromkeys(names, OLD.public_key)), clock)

    await book.look_up(names[:3])
    await book.look_up(names[3:])

    # The oldest key is forgotten before new ones are looked up.
    assert [book.has_key(each) for each in names] == [False, True, True, True]
