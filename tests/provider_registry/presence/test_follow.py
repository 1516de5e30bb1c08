"""Presence in the database never goes back, and needs the drone's own provider."""

import asyncio
import random
from collections.abc import AsyncIterator, Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence.follow import PresenceFollower, Recorder
from skyway_provider_registry.presence.sighting_store import record

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import COUNTERS
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database, Tx

pytestmark = pytest.mark.databases("sqlite")

TOPICS: dict[type, Topic[Any]] = {Connection: CONNECTION, DroneState: STATE, Telemetry: TELEMETRY}


class Fleet:
    """One provider's drone, and what the registry shows of it."""

    def __init__(self, api: Any, db: Database, clock: ManualClock) -> None:
        self.api, self.db, self.clock = api, db, clock
        self.provider_id = ""

    async def drone(self) -> str:
        self.provider_id = self.provider_id or await self.api.provider()
        return str((await self.api.drone(self.provider_id))["drone_id"])

    async def receives(self, drone_id: str, *messages: Any, under: str | None = None) -> None:
        provider_id = under or self.provider_id
        batch = [
            Received(TOPICS[type(message)], (provider_id, drone_id), message, False)
            for message in messages
        ]
        await Recorder(self.db, self.clock).record(batch)

    async def shows(self, drone_id: str) -> dict[str, Any]:
        path = f"/v1/providers/{self.provider_id}/drones/{drone_id}"
        answer = await self.api("operator:op", "GET", path)
        shown: dict[str, Any] = answer.json()
        return shown


@pytest.fixture
def fleet(api: Any, db: Database, clock: ManualClock) -> Fleet:
    return Fleet(api, db, clock)


Maker = Callable[..., Any]


async def test_the_messages_of_a_drone_are_shown(
    fleet: Fleet, clock: ManualClock, online: Maker, state: Maker
) -> None:
    drone_id = await fleet.drone()
    clock.advance(timedelta(minutes=1))

    await fleet.receives(drone_id, online(7, 1), state(7, 1, soc=0.8, activity="WAITING"))

    shown = await fleet.shows(drone_id)
    assert shown["state"] == "AVAILABLE"
    assert (shown["station_id"], shown["soc"]) == ("san-marcos", 0.8)
    assert (shown["position"], shown["activity"]) == ([-97.9, 29.9], "WAITING")
    assert shown["last_seen_at"] == "2026-03-01T12:01:00Z"


async def test_a_flying_drone_is_shown_where_its_telemetry_is(
    fleet: Fleet, online: Maker, state: Maker, sample: Maker
) -> None:
    drone_id = await fleet.drone()
    flying = state(7, 1, activity="FLYING", station_id=None, mission_id="msn_1")

    await fleet.receives(drone_id, online(7, 1), flying, sample(7, 1, later_s=5))

    shown = await fleet.shows(drone_id)
    assert (shown["position"], shown["soc"]) == ([-98.0, 29.5], 0.5)
    assert (shown["state"], shown["mission_id"]) == ("ON_MISSION", "msn_1")


@pytest.mark.parametrize(
    ("first", "late"),
    [((7, 5), (7, 4)), ((7, 5), (7, 5)), ((8, 1), (7, 900))],
)
async def test_an_older_state_changes_nothing(
    fleet: Fleet, state: Maker, first: tuple[int, int], late: tuple[int, int]
) -> None:
    drone_id = await fleet.drone()

    await fleet.receives(drone_id, state(*first, soc=0.7))
    await fleet.receives(drone_id, state(*late, soc=0.1))

    assert (await fleet.shows(drone_id))["soc"] == 0.7


async def test_a_drone_whose_clock_is_wrong_is_ordered_by_its_numbers(
    fleet: Fleet, clock: ManualClock, state: Maker
) -> None:
    drone_id = await fleet.drone()
    ahead, behind = clock.now() + timedelta(seconds=20), clock.now() - timedelta(days=6)

    await fleet.receives(drone_id, state(7, 1, soc=0.1, at=ahead, sent_at=ahead))
    await fleet.receives(drone_id, state(7, 2, soc=0.7, at=behind, sent_at=behind))

    assert (await fleet.shows(drone_id))["soc"] == 0.7


async def test_the_last_will_of_an_old_connection_is_ignored(fleet: Fleet, online: Maker) -> None:
    drone_id = await fleet.drone()

    await fleet.receives(drone_id, online(7, 1), online(7, 2))
    await fleet.receives(drone_id, online(7, 1, "LOST"))
    still = (await fleet.shows(drone_id))["state"]
    await fleet.receives(drone_id, online(7, 2, "LOST"))
    lost = (await fleet.shows(drone_id))["state"]
    await fleet.receives(drone_id, online(7, 2))

    assert (still, lost) == ("REGISTERED", "OFFLINE")
    assert (await fleet.shows(drone_id))["state"] == "OFFLINE"


@pytest.mark.databases("sqlite", "postgresql")
async def test_any_order_in_any_batches_gives_the_result_of_the_sending_order(
    fleet: Fleet, online: Maker, state: Maker, sample: Maker
) -> None:
    there, flies = sample(7, 1).position, {"activity": "FLYING", "station_id": None}
    life = [
        message
        for session in (7, 9)
        for number in (1, 2)
        for message in (
            online(session, number),
            state(session, 10 * number, soc=0.6, position=there),
            sample(session, 10 * number, later_s=number),
            state(session, 10 * number + 1, soc=0.5, position=there, **flies),
            sample(session, 10 * number + 1, later_s=10 + number, soc=0.41),
            online(session, number, "LOST"),
        )
    ]
    reference = await fleet.drone()
    await fleet.receives(reference, *life)
    expected = await fleet.shows(reference)

    for seed in range(12):
        chance = random.Random(seed)
        shuffled = [*life, *chance.choices(life, k=6)]
        chance.shuffle(shuffled)
        drone_id = await fleet.drone()
        while shuffled:
            size = chance.randint(1, 6)
            await fleet.receives(drone_id, *shuffled[:size])
            shuffled = shuffled[size:]

        shown = await fleet.shows(drone_id)
        # What a drone has flown is counted between the states that were seen.
        assert shown == {
            **expected,
            "drone_id": drone_id,
            "maintenance": shown["maintenance"],
        }, seed


async def test_simultaneous_batches_give_the_result_of_successive_batches(
    fleet: Fleet, state: Maker
) -> None:
    drone_id = await fleet.drone()

    await asyncio.gather(
        *(fleet.receives(drone_id, state(7, seq, soc=seq / 100)) for seq in range(30, 0, -1))
    )

    assert (await fleet.shows(drone_id))["soc"] == 0.3


async def test_messages_under_another_provider_are_dropped(
    fleet: Fleet, online: Maker, state: Maker
) -> None:
    drone_id = await fleet.drone()
    other = await fleet.api.provider()
    dropped = COUNTERS.value("skyway_presence_dropped")

    await fleet.receives(drone_id, online(7, 1), state(7, 9, soc=0.1), under=other)

    shown = await fleet.shows(drone_id)
    assert (shown["state"], shown["soc"]) == ("REGISTERED", 1.0)
    assert COUNTERS.value("skyway_presence_dropped") == dropped + 2


async def test_messages_of_an_unregistered_drone_are_dropped(
    fleet: Fleet, online: Maker, state: Maker
) -> None:
    known = await fleet.drone()

    await fleet.receives("drn_unknown", online(7, 1), state(7, 1))
    await fleet.receives(known, online(7, 1), state(7, 1))

    assert (await fleet.shows(known))["state"] == "AVAILABLE"


async def test_a_batch_that_cannot_be_stored_is_stored_later(
    fleet: Fleet, migrated_url: str, clock: ManualClock, state: Maker
) -> None:
    drone_id = await fleet.drone()
    batch = [Received(STATE, (fleet.provider_id, drone_id), state(7, 1, soc=0.4), False)]

    async def batches() -> AsyncIterator[list[Received[Any]]]:
        yield batch

    late = Database(migrated_url)
    follower = PresenceFollower(batches(), db=late, clock=clock)
    with pytest.raises(ServiceUnavailable):
        await follower.step()
    async with late:
        await follower.step()

    assert (await fleet.shows(drone_id))["soc"] == 0.4


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_message_that_cannot_be_stored_is_dropped_alone(
    fleet: Fleet, db: Database, clock: ManualClock, state: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    drone_ids = [await fleet.drone() for _ in range(5)]
    batch = [
        Received(STATE, (fleet.provider_id, drone_id), state(7, 1, soc=0.4), False)
        for drone_id in drone_ids
    ]

    async def batches() -> AsyncIterator[list[Received[Any]]]:
        yield batch

    async def fails_for_one(tx: Tx, sightings: Any, received_at: Any, **members: Any) -> None:
        if drone_ids[2] in sightings:
            raise RuntimeError("this message cannot be stored")
        await record(tx, sightings, received_at, **members)

    monkeypatch.setattr("skyway_provider_registry.presence.follow.record", fails_for_one)

    await PresenceFollower(batches(), db=db, clock=clock).step()

    shown = [(await fleet.shows(drone_id))["soc"] for drone_id in drone_ids]
    assert shown == [0.4, 0.4, 1.0, 0.4, 0.4]


@pytest.mark.parametrize("number", [2**53 - 1, 0])
async def test_the_largest_and_smallest_numbers_can_be_stored(
    fleet: Fleet, online: Maker, state: Maker, sample: Maker, number: int
) -> None:
    drone_id = await fleet.drone()

    await fleet.receives(
        drone_id, online(number, number), state(number, number), sample(number, number)
    )

    assert (await fleet.shows(drone_id))["state"] == "AVAILABLE"


HEALTH = {
    "voltage_v": 22.1,
    "current_a": 30.0,
    "soc_error": 0.01,
    "cell_spread_v": 0.02,
    "temperature_c": 31.0,
    "state_of_health": 0.93,
    "range_m": 4200.0,
}


async def test_the_reported_health_of_a_drone_is_shown(
    fleet: Fleet, online: Maker, state: Maker
) -> None:
    drone_id = await fleet.drone()
    before = await fleet.shows(drone_id)
    escape = {"fault": "BATTERY_SHORT", "failsafe": "DIVERT", "station_id": "mcqueeney"}

    await fleet.receives(
        drone_id,
        online(7, 1),
        state(7, 1, health=HEALTH, faults=["BATTERY_SHORT", "LINK_LOST"], failsafe=escape),
    )
    shown = await fleet.shows(drone_id)
    await fleet.receives(drone_id, state(7, 2))
    after = await fleet.shows(drone_id)

    assert (before["health"], before["faults"], before["failsafe"]) == (None, [], None)
    assert shown["health"].items() >= HEALTH.items()
    assert (shown["faults"], shown["failsafe"]) == (["BATTERY_SHORT", "LINK_LOST"], escape)
    assert (after["health"], after["faults"], after["failsafe"]) == (None, [], None)


async def test_the_picture_shows_where_a_drone_in_flight_could_land_instead(
    fleet: Fleet, online: Maker, state: Maker
) -> None:
    drone_id = await fleet.drone()
    health = {**HEALTH, "safe_landings": ["kyle", "buda", "niederwald", "uhland"]}

    async def landings() -> list[str] | None:
        answer = await fleet.api(None, "GET", "/internal/live/drones", service="gateway")
        found: list[str] | None = answer.json()["drones"][0].get("safe_landings")
        return found

    await fleet.receives(drone_id, online(7, 1), state(7, 1, activity="FLYING", health=health))
    in_flight = await landings()
    await fleet.receives(drone_id, state(7, 2, activity="WAITING", health=health))

    assert (in_flight, await landings()) == (["kyle", "buda", "niederwald"], None)


async def test_a_drone_that_is_down_is_grounded(fleet: Fleet, online: Maker, state: Maker) -> None:
    drone_id = await fleet.drone()

    await fleet.receives(drone_id, online(7, 1), state(7, 1, activity="DOWN", station_id=None))

    shown = await fleet.shows(drone_id)
    assert (shown["state"], shown["activity"]) == ("GROUNDED", "DOWN")
