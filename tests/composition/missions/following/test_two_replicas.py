"""Two replicas share the drones; when one is killed, the other one catches up on its drones."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.links.listening import Listening
from skyway_composition.missions.following.follow import Follower, GainedDrones
from skyway_composition.missions.timeouts import OverdueMissions
from skyway_composition.parts import Parts
from skyway_composition.quarantine.set_aside import Quarantine
from skyway_composition.tables import replicas

from skyway.contracts.topics import Topic
from skyway.ids import DroneId
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import Inbox
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import DEAD_AFTER_MS, ReplicaStore
from tests.composition.drone_messages import DroneMessages

pytestmark = [
    pytest.mark.integration,
    pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True),
]

EXPIRY, ACK_ON_ITS_WAY = timedelta(seconds=61), timedelta(seconds=10)


@dataclass
class Broker:
    """Passes each message to all replicas, and keeps what is retained."""

    inboxes: list[Inbox] = field(default_factory=list)
    retained: dict[str, bytes] = field(default_factory=dict)

    def publish(self, *messages: Received[Any]) -> None:
        for each in messages:
            name = each.topic(*each.ids).name
            if each.topic.retained:
                self.retained[name] = each.payload
            for inbox in self.inboxes:
                inbox.offer(name, each.payload, retained=False)

    def send_retained(self, inbox: Inbox) -> None:
        for name, payload in self.retained.items():
            inbox.offer(name, payload, retained=True)


@dataclass
class Subscriber:
    """The connection of one replica to the broker."""

    broker: Broker
    inbox: Inbox = field(init=False)

    def batches(self, *topics: Topic[Any], doorkeeper: Any) -> AsyncIterator[list[Received[Any]]]:
        self.inbox = Inbox(topics, doorkeeper)
        self.broker.inboxes.append(self.inbox)
        return self.inbox.batches()

    def subscribe_again(self) -> None:
        self.broker.send_retained(self.inbox)


class Replica:
    """A replica of composition that follows drones when the test lets it."""

    def __init__(self, shared: Parts, broker: Broker, own_id: str) -> None:
        self.membership = Membership(
            ReplicaStore(shared.db, replicas), own_id=own_id, clock=shared.clock
        )
        self.membership.set_listening(True)
        listening = Listening(shared.clock, self.membership)
        listening.begin()
        quarantine = Quarantine(
            shared.db, clock=shared.clock, mint=shared.mint, listening=listening
        )
        self.parts = replace(shared, listening=listening, quarantine=quarantine)
        self.subscriber = Subscriber(broker)
        handler = self.parts.handler
        self.follower = Follower(
            handler,
            self.subscriber,
            doorkeeper=SignatureCheck(shared.keys, quarantine),
            clock=shared.clock,
            quarantine=quarantine,
            listening=listening,
        )
        self.gained = GainedDrones(
            handler,
            self.subscriber.subscribe_again,
            membership=self.membership,
            clock=shared.clock,
        )
        self.overdue = OverdueMissions(shared, listening)

    async def handle_all(self) -> int:
        """Handle what has arrived; how many messages that was."""
        arrived = self.subscriber.inbox.waiting
        if arrived:
            await self.follower.step()
        return arrived


@dataclass
class Pair:
    broker: Broker
    one: Replica
    other: Replica

    async def beat(self) -> None:
        for each in (self.one, self.other, self.one):
            await each.membership.step()

    async def lose_the_other(self) -> None:
        """The other replica is killed, and the first one notices this."""
        async with self.one.parts.db.write() as tx:
            seen_ms = replicas.c.seen_wall_ms - DEAD_AFTER_MS - 100
            await tx.execute(replicas.update().values(seen_wall_ms=seen_ms))
        await self.one.membership.step()
        await self.one.gained.step()


@pytest.fixture
async def pair(composition: Any) -> Pair:
    broker, parts = Broker(), composition.parts
    await parts.keys.look_up([DroneId(f"drn_{number}") for number in range(20)])
    pair = Pair(broker, Replica(parts, broker, "one"), Replica(parts, broker, "other"))
    await pair.beat()
    return pair


@pytest.fixture
def drone(composition: Any, pair: Pair) -> DroneMessages:
    """A drone of the replica that is killed."""
    number = next(n for n in range(20) if pair.other.membership.owns(f"drn_{n}"))
    return DroneMessages(composition, f"drn_{number}")


async def booked(composition: Any, make: Any, drone: DroneMessages) -> Any:
    await composition.book(make.candidate(int(drone.drone_id.removeprefix("drn_"))))
    (instruction,) = await composition.sent(drone.drone_id)
    return instruction


async def test_a_flight_goes_on_when_the_owner_of_its_drone_is_killed(
    composition: Any, make: Any, pair: Pair, drone: DroneMessages
) -> None:
    instruction = await booked(composition, make, drone)
    drone.stream = instruction.stream
    composition.clock.advance(timedelta(hours=12))
    events = drone.flown(instruction)

    pair.broker.publish(drone.ack(instruction), *events[:2])
    assert (await pair.one.handle_all(), await pair.other.handle_all()) == (0, 3)
    assert await composition.state_of(instruction.mission_id) == "ACTIVE"

    # These messages are lost with the killed replica, except for what the broker has retained.
    pair.broker.publish(*events[2:], drone.state(), drone.connection("ONLINE"))
    await pair.lose_the_other()
    asked = (await composition.sent(drone.drone_id))[-1]
    assert (asked.kind, asked.events_after_seq) == ("REPORT", 2)
    assert await pair.one.handle_all() == 2

    pair.broker.publish(*events[2:])
    await pair.one.handle_all()
    await pair.other.handle_all()  # the other replica was only frozen, and handles all once more

    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    custody = await composition.rows("SELECT custodian_kind FROM custody ORDER BY seq")
    assert [row.custodian_kind for row in custody] == ["STATION", "DRONE", "RECIPIENT"]
    kinds = [each.kind for each in await composition.reports()]
    assert [kinds.count(each) for each in ("ACCEPTED", "LOADED", "DELIVERED", "ENDED")] == [1] * 4
    assert await composition.broken() == []


async def test_only_a_replica_that_has_owned_a_silent_drone_gives_its_booking_up(
    composition: Any, make: Any, pair: Pair, drone: DroneMessages
) -> None:
    instruction = await booked(composition, make, drone)
    pair.broker.publish(drone.connection("LOST"))
    await pair.other.handle_all()
    composition.clock.advance(EXPIRY + ACK_ON_ITS_WAY)

    await pair.one.overdue.step()
    await pair.lose_the_other()
    await pair.one.overdue.step()
    assert await composition.state_of(instruction.mission_id) == "BOOKED"

    await pair.other.overdue.step()  # it lives on, and does not know that it counts as dead
    assert await composition.state_of(instruction.mission_id) == "REFUSED"
