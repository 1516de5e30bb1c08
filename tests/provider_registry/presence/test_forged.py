"""The registry believes of a drone that signs only what it has signed; each replica does."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.enrolment.signing_store import StoredKeys
from skyway_provider_registry.presence.follow import PRESENCE_TOPICS, Recorder
from skyway_provider_registry.presence.judge_states import NoQuarantine

from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.inbox import Inbox
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.signing.key_pair import PrivateKey
from skyway.runtime.sql.database import Database

KEY, NEXT = PrivateKey(b"1" * 32), PrivateKey(b"2" * 32)


class Replica:
    """One process that follows presence."""

    def __init__(self, db: Database, clock: ManualClock, drone: Any) -> None:
        self._ids = (drone["provider_id"], drone["drone_id"])
        self.book = KeyBook(StoredKeys(db, clock), clock)
        self._check = SignatureCheck(self.book, NoQuarantine())
        self._inbox = Inbox(PRESENCE_TOPICS, self._check)
        self._batches = self._inbox.batches()
        self._recorder = Recorder(db, clock)
        self._clock = clock

    async def arrive(self, topic: Topic[Any], message: Any, key: PrivateKey | None) -> None:
        name = topic(*self._ids).name
        payload = message.model_dump_json().encode()
        payload = payload if key is None else key.signed(name, payload)
        self._inbox.offer(name, payload, retained=False)
        reading = asyncio.ensure_future(anext(self._batches))
        for _ in range(2):
            await asyncio.sleep(0)
            self._clock.advance(timedelta(seconds=3))
            await self._check.step()
        await asyncio.sleep(0)
        if reading.done():
            await self._recorder.record(reading.result())
        else:
            reading.cancel()
            self._batches = self._inbox.batches()


@pytest.fixture
async def drone(api: Any) -> Any:
    return await api.drone(await api.provider(), public_key=KEY.public_key)


async def shown(api: Any, drone: Any) -> Any:
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    return (await api("operator:op", "GET", path)).json()


@pytest.mark.parametrize("key", [None, NEXT], ids=["stripped", "of another drone"])
async def test_forged_presence_changes_nothing(
    api: Any,
    drone: Any,
    db: Database,
    clock: ManualClock,
    key: PrivateKey | None,
    online: Any,
    state: Any,
    sample: Any,
) -> None:
    replica = Replica(db, clock, drone)
    await replica.arrive(CONNECTION, online(1, 1), KEY)
    await replica.arrive(STATE, state(1, 1), KEY)
    before = await shown(api, drone)

    await replica.arrive(CONNECTION, online(1, 1, "LOST"), key)
    await replica.arrive(STATE, state(9, 9, activity="DOWN"), key)
    await replica.arrive(TELEMETRY, sample(9, 9), key)

    assert before["state"] == "AVAILABLE"
    assert await shown(api, drone) == before


async def test_old_signed_messages_do_not_turn_the_clock_back(
    api: Any, drone: Any, db: Database, clock: ManualClock, online: Any, state: Any
) -> None:
    replica = Replica(db, clock, drone)
    old = state(1, 1, activity="DOWN")
    await replica.arrive(STATE, old, KEY)
    await replica.arrive(CONNECTION, online(1, 2), KEY)
    await replica.arrive(STATE, state(1, 2), KEY)
    before = await shown(api, drone)

    await replica.arrive(STATE, old, KEY)
    await replica.arrive(CONNECTION, online(1, 1, "LOST"), KEY)

    assert await shown(api, drone) == before


async def test_every_replica_drops_a_replaced_key(
    api: Any, drone: Any, db: Database, clock: ManualClock, online: Any, state: Any
) -> None:
    replicas = [Replica(db, clock, drone) for _ in range(2)]
    for number, replica in enumerate(replicas, 1):
        await replica.arrive(STATE, state(1, number), KEY)
    body = {"enrolment_token": drone["enrolment_token"], "public_key": NEXT.public_key}
    answer = await api("service:gateway", "POST", "/v1/enrolments", body)
    assert answer.status_code == 201, answer.text

    for replica in replicas:
        await replica.book.refresh()
        await replica.arrive(STATE, state(1, 9, activity="DOWN"), KEY)
    unchanged = (await shown(api, drone))["activity"]
    await replicas[0].arrive(STATE, state(1, 10, activity="WAITING"), NEXT)

    assert unchanged == "IDLE"
    assert (await shown(api, drone))["activity"] == "WAITING"
