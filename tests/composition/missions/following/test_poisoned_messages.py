"""A message that cannot be handled: the others of its batch must not be lost with it."""

import itertools
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

import pytest
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.follow import Follower
from skyway_composition.missions.following.handle_report import handle_state
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

from skyway.contracts.drone_report import DroneState
from skyway.contracts.topics import Topic
from skyway.ids import DroneId
from skyway.runtime.mqtt.client import Received

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

DRONE = DroneId("drn_1")

#: The function that handles states, as the follower calls it.
HANDLE_STATE = "skyway_composition.missions.following.follow.handle_state"


@dataclass
class OneBatch:
    """`Subscriber` on which one batch arrives."""

    batch: list[Received[Any]]

    async def batches(self, *_: Topic[Any], **__: Any) -> AsyncIterator[list[Received[Any]]]:
        yield self.batch


async def fail(*_: object) -> None:
    raise RuntimeError("this state cannot be handled")


def failing(times: int) -> Callable[..., Awaitable[None]]:
    """Handles states, but fails this often at first."""
    left = itertools.repeat(None, times)

    async def handle(work: MissionUnitOfWork, link: DroneLink, state: DroneState) -> None:
        for _ in left:
            await fail()
        await handle_state(work, link, state)

    return handle


def following(composition: Any, *batch: Received[Any]) -> Follower:
    """A follower to which one batch has arrived."""
    return Follower(
        composition.handler,
        OneBatch([*batch]),
        doorkeeper=composition.parts.signatures,
        clock=composition.clock,
        quarantine=composition.parts.quarantine,
        listening=composition.listening,
    )


async def test_only_the_message_that_cannot_be_handled_is_dropped(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    monkeypatch.setattr(HANDLE_STATE, fail)
    follower = following(composition, drone.state(activity="FLYING"), drone.ack(instruction))

    for _ in range(3):
        with pytest.raises(RuntimeError):
            await follower.step()
    await follower.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


@pytest.mark.parametrize("rate", [1.0, 600.0])
async def test_an_event_about_the_future_counts_only_when_its_time_has_come(
    composition: Any, drone: Any, make: Any, begin: Any, rate: float
) -> None:
    composition.clock.rate = rate
    instruction = await begin.loaded(composition, drone, make)
    flight = next(each for each in instruction.steps if each.kind == "FLY")
    (event,) = drone.ended(instruction, [flight], late_by=timedelta(hours=2))
    before = await composition.rows("SELECT last_event_seq FROM drone_links")

    await following(composition, event).step()
    assert await composition.rows("SELECT last_event_seq FROM drone_links") == before

    composition.clock.advance(timedelta(hours=4))
    await following(composition, event).step()
    assert await composition.rows("SELECT last_event_seq FROM drone_links") != before


async def test_a_dropped_message_may_have_been_the_answer_to_an_earlier_booking(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    booked_at = composition.clock.now()
    composition.clock.advance(timedelta(seconds=1))
    assert composition.listening.covers(DRONE, booked_at, composition.clock.now())
    monkeypatch.setattr(HANDLE_STATE, fail)
    follower = following(composition, drone.state(activity="FLYING"))

    for _ in range(3):
        with pytest.raises(RuntimeError):
            await follower.step()
    await follower.step()

    assert not composition.listening.covers(DRONE, booked_at, composition.clock.now())


@pytest.mark.parametrize("times", [1, 2, 3])
async def test_a_message_is_handled_when_its_failure_passes(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    monkeypatch.setattr(HANDLE_STATE, failing(times))
    flying = drone.state(mission_id=instruction.mission_id, activity="FLYING", step_id=2)
    follower = following(composition, drone.ack(instruction), flying)

    for _ in range(times):
        with pytest.raises(RuntimeError):
            await follower.step()
    await follower.step()

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"


async def test_other_drones_do_not_wait_for_a_message_that_fails(
    composition: Any, drone: Any, make: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    other = replace(drone, drone_id="drn_2")
    monkeypatch.setattr(HANDLE_STATE, fail)
    follower = following(composition, other.state(), drone.ack(instruction), drone.ack(instruction))

    with pytest.raises(RuntimeError):
        await follower.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_messages_of_a_provider_that_failed_before_are_not_tried_again(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(HANDLE_STATE, fail)
    first = following(composition, drone.state())
    for _ in range(3):
        with pytest.raises(RuntimeError):
            await first.step()
    await first.step()

    await following(composition, replace(drone, drone_id="drn_2").state()).step()

    await composition.parts.quarantine.step()
    rows = await composition.rows("SELECT drone_id, reason FROM quarantine ORDER BY drone_id")
    assert [tuple(row) for row in rows] == [("drn_1", "FAILED"), ("drn_2", "FAILED")]


@pytest.mark.parametrize("is_retained", [False, True])
async def test_a_state_of_long_ago_is_not_taken(
    composition: Any, drone: Any, is_retained: bool
) -> None:
    await composition.receive(drone.state())
    long_ago = composition.clock.now() - timedelta(days=30)
    old = replace(drone.state(at=long_ago, soc=0.1), retained=is_retained)

    await following(composition, old).step()
    await composition.parts.quarantine.step()

    rows = await composition.rows("SELECT reason FROM quarantine")
    assert [reason for (reason,) in rows] == ([] if is_retained else ["BEHIND"])
    (link,) = await composition.rows("SELECT state FROM drone_links")
    assert '"soc":1.0' in link.state


async def test_an_alarm_of_hours_ago_is_raised_with_its_moment(
    composition: Any, drone: Any
) -> None:
    at = composition.clock.now() - timedelta(hours=20)

    await following(composition, drone.event("ALARM", code="GPS_LOST", ended_at=at)).step()

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert datetime.fromisoformat(alarm["at"]) == at
