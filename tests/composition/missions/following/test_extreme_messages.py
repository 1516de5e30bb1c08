"""Every extreme value at every place of a drone's message: no message stops composition."""

import json
from typing import Any

import pytest
from pydantic import ValidationError
from skyway_composition.missions.following.plausibility import is_ahead
from skyway_lab.benchmarks.hostile.messages import extreme_messages

from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.moments import latest_believed

#: Messages that are handled in one transaction.
_BATCH = 100


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize("kind", ["ack", "step", "alarm", "state", "connection"])
async def test_no_extreme_value_stops_the_messages_of_others(
    composition: Any, drone: Any, make: Any, begin: Any, kind: str
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    flight = next(each for each in instruction.steps if each.kind == "FLY")
    composition.clock.advance(flight.planned_end_at - composition.clock.now())

    def sent() -> Received[Any]:
        match kind:
            case "ack":
                message = drone.ack(instruction)
            case "step":
                (message,) = drone.ended(instruction, [flight])
            case "alarm":
                message = drone.event("ALARM", code="BATTERY_LOW", level="CRITICAL", detail="x")
            case "state":
                message = drone.state(mission_id=instruction.mission_id, activity="FLYING")
            case _:
                message = drone.connection("ONLINE", number=drone.sent)
        received: Received[Any] = message
        return received

    first = sent()
    taken, refused = [], 0
    for payload in extreme_messages(first.topic, lambda: json.loads(sent().payload)):
        try:
            message = first.topic.read(payload)
        except ValidationError:
            refused += 1
            continue
        if not is_ahead(message, latest_at=latest_believed(composition.clock)):
            taken.append(Received(first.topic, first.ids, message, False, payload))

    assert refused > len(taken) > 0
    for start in range(0, len(taken), _BATCH):
        await composition.handler.handle(taken[start : start + _BATCH])
    (counted,) = await composition.rows("SELECT count(*) FROM drone_links")
    assert counted[0] == 1
