"""Every extreme value at every place of a drone's message: the registry still shows the fleet."""

from collections.abc import Callable
from typing import Any

import pytest
from pydantic import ValidationError
from skyway_lab.benchmarks.hostile.messages import extreme_messages

from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.runtime.clock import ManualClock
from tests.provider_registry.presence.test_follow import Fleet

pytestmark = pytest.mark.databases("sqlite")

#: Messages after which the drone is looked at.
_SHOWN_EVERY = 20


@pytest.fixture
def fleet(api: Any, db: Any, clock: ManualClock) -> Fleet:
    return Fleet(api, db, clock)


@pytest.mark.parametrize("kind", ["state", "sample", "online"])
async def test_no_extreme_value_hides_a_drone(
    fleet: Fleet, request: pytest.FixtureRequest, kind: str
) -> None:
    make: Callable[..., Any] = request.getfixturevalue(kind)
    topics: dict[str, Topic[Any]] = {"state": STATE, "sample": TELEMETRY, "online": CONNECTION}
    topic = topics[kind]
    drone_id = await fleet.drone()
    taken, refused, sent = [], 0, 0

    def example() -> dict[str, Any]:
        nonlocal sent
        sent += 1
        made: dict[str, Any] = make(1, sent).model_dump(mode="json")
        return made

    for payload in extreme_messages(topic, example):
        try:
            taken.append(topic.read(payload))
        except ValidationError:
            refused += 1

    assert refused > len(taken) > 0
    for number, message in enumerate(taken):
        # Alone: of several only the newest is stored.
        await fleet.receives(drone_id, message)
        if number % _SHOWN_EVERY == 0:
            assert (await fleet.shows(drone_id))["drone_id"] == drone_id
    assert (await fleet.shows(drone_id))["drone_id"] == drone_id
