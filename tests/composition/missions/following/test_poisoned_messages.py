"""A message that cannot be handled: the others of its batch must not be lost with it."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import pytest
from skyway_composition.missions.following.follow import Follower

from skyway.contracts.topic import Topic
from skyway.runtime.loops import Wake
from skyway.runtime.mqtt.client import Received

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: The function that handles states, as the follower calls it.
HANDLE_STATE = "skyway_composition.missions.following.follow.handle_state"


@dataclass
class OneBatch:
    """`Subscriber` on which one batch arrives."""

    batch: list[Received[Any]]

    async def batches(self, *_: Topic[Any]) -> AsyncIterator[list[Received[Any]]]:
        yield self.batch


async def fail(*_: object) -> None:
    raise RuntimeError("this state cannot be handled")


async def test_only_the_message_that_cannot_be_handled_is_dropped(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    monkeypatch.setattr(HANDLE_STATE, fail)
    follower = Follower(
        composition.db,
        OneBatch([drone.state(activity="FLYING"), drone.ack(instruction)]),
        clock=composition.clock,
        mint=composition.parts.mint,
        stuck=Wake(),
        listening=composition.listening,
    )

    for _ in range(3):
        with pytest.raises(RuntimeError):
            await follower.step()
    await follower.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"
