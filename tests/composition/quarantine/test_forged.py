"""A message that its drone has not signed changes nothing, and does not count against the drone."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.following.quarantine_routes import Replays
from skyway_composition.quarantine.set_aside import Quarantine

from skyway.contracts.drones import DroneSignature
from skyway.contracts.topics import EVENTS, STATE
from skyway.ids import DroneId, QuarantineId
from skyway.runtime.errors import Conflict
from skyway.runtime.mqtt.inbox import Inbox
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.signing.key_pair import PrivateKey

KEY = PrivateKey(b"1" * 32)
SENDER = ("prv_1", "drn_1")


class SigningDrones:
    """A `KeySource` in which every drone signs with the same key."""

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        return [
            DroneSignature(drone_id=each, is_signed=True, public_key=KEY.public_key)
            for each in drone_ids
        ]

    async def changed(self) -> Sequence[DroneSignature]:
        return ()


@dataclass
class Door:
    """What arrives from the broker, on its way to the handler of messages."""

    composition: Any
    quarantine: Quarantine

    def __post_init__(self) -> None:
        self.book = KeyBook(SigningDrones(), self.composition.clock)
        self.check = SignatureCheck(self.book, self.quarantine)
        self.inbox = Inbox((EVENTS, STATE), self.check)

    async def arrive(self, *signed: tuple[Any, PrivateKey | None]) -> None:
        """Let messages arrive, signed with these keys, and handle what is believed."""
        for received, key in signed:
            name = received.topic(*received.ids).name
            payload = received.message.model_dump_json().encode()
            payload = payload if key is None else key.signed(name, payload)
            self.inbox.offer(name, payload, retained=False)
        await self._handle()
        self.composition.clock.advance(timedelta(seconds=3))
        await self.check.step()
        await self._handle()
        await self.quarantine.step()

    async def _handle(self) -> None:
        marker = STATE("prv_0", "drn_0").name
        await self.book.look_up([DroneId("drn_0")])
        end = self.composition.last_state
        self.inbox.offer(marker, KEY.signed(marker, end), retained=False)
        batch = await anext(self.inbox.batches())
        mine = [each for each in batch if each.ids == SENDER]
        if mine:
            await self.composition.receive(*mine)


@pytest.fixture
async def door(composition: Any, drone: Any) -> Door:
    composition.last_state = drone.state().message.model_dump_json().encode()
    return Door(composition, composition.parts.quarantine)


async def kept(composition: Any) -> list[Any]:
    return list(await composition.rows("SELECT * FROM quarantine ORDER BY quarantine_id"))


async def test_a_forged_hand_over_changes_nothing_and_the_drones_own_counts(
    composition: Any, drone: Any, door: Door
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    *events, last = drone.flown(instruction)
    await door.arrive(*((each, KEY) for each in events))
    before = await composition.state_of(instruction.mission_id)

    await door.arrive((last, None))
    await door.arrive((last, PrivateKey.new()))
    unchanged = await composition.state_of(instruction.mission_id)
    await door.arrive((last, KEY))

    assert (before, unchanged) == ("ACTIVE", "ACTIVE")
    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    assert {row.reason for row in await kept(composition)} == {"FORGED"}
    assert await composition.broken() == []


async def test_forgeries_alarm_operators_and_neither_slow_nor_put_out_the_drone(
    composition: Any, drone: Any, door: Door
) -> None:
    for _ in range(30):
        await door.arrive(*((drone.state(), None) for _ in range(30)))

    assert not door.quarantine.is_shut_out(SENDER)
    (alarm,) = await composition.rows("SELECT * FROM alarms")
    assert (alarm.code, alarm.level, alarm.drone_id) == ("FORGED_MESSAGES", "URGENT", "drn_1")
    assert len(await kept(composition)) <= 20
    # It is not slowed: its own message that cannot be read is still kept.
    wrong = KEY.signed(STATE(*SENDER).name, b'{"seq":1}')
    door.inbox.offer(STATE(*SENDER).name, wrong, retained=False)
    await door.arrive((drone.state(), KEY))
    assert "UNREADABLE" in {row.reason for row in await kept(composition)}


async def test_two_forged_messages_raise_no_alarm(composition: Any, drone: Any, door: Door) -> None:
    await door.arrive((drone.state(), None), (drone.state(), None))

    assert len(await kept(composition)) == 2
    assert await composition.rows("SELECT * FROM alarms") == []


async def test_a_forged_message_is_not_replayed(composition: Any, drone: Any, door: Door) -> None:
    await door.arrive((drone.state(activity="DOWN"), None))
    (row,) = await kept(composition)
    replays = Replays(composition.parts, composition.handler, door.book)

    with pytest.raises(Conflict, match="has not signed it"):
        await replays.replay(QuarantineId(row.quarantine_id))

    assert len(await kept(composition)) == 1


async def test_a_signed_message_is_replayed(composition: Any, drone: Any, door: Door) -> None:
    early = drone.state()
    payload = KEY.signed(STATE(*SENDER).name, early.message.model_dump_json().encode())
    door.quarantine.add(replace(early, payload=payload), "FAILED", "a bug")
    await door.quarantine.step()
    (row,) = await kept(composition)

    await Replays(composition.parts, composition.handler, door.book).replay(
        QuarantineId(row.quarantine_id)
    )

    assert await kept(composition) == []
