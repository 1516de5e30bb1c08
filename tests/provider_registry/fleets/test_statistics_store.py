"""GET /v1/stats/fleets counts drones in the states in which they are shown."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence.follow import Recorder

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

TOPICS: dict[Any, Topic[Any]] = {
    Connection: CONNECTION,
    DroneState: STATE,
    Telemetry: TELEMETRY,
}

Maker = Callable[..., Any]


@pytest.fixture
async def provider_id(api: Any) -> str:
    made: str = await api.provider()
    return made


async def asked(api: Any, caller: str = "operator:op") -> Any:
    answer = await api(caller, "GET", "/v1/stats/fleets")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def said(
    api: Any, db: Database, clock: ManualClock, provider_id: str, *messages: Any
) -> dict[str, Any]:
    """A new drone that has said all this, as it is shown then."""
    drone_id = (await api.drone(provider_id))["drone_id"]
    batch = [Received(TOPICS[type(one)], (provider_id, drone_id), one, False) for one in messages]
    await Recorder(db, clock).record(batch)
    path = f"/v1/providers/{provider_id}/drones/{drone_id}"
    shown: dict[str, Any] = (await api("operator:op", "GET", path)).json()
    return shown


async def test_drones_are_counted_in_the_states_in_which_they_are_shown(
    api: Any, db: Database, clock: ManualClock, provider_id: str, online: Maker, state: Maker
) -> None:
    shown = [
        await said(api, db, clock, provider_id, *messages)
        for messages in (
            (online(7, 1), state(7, 1)),
            (online(7, 1), state(7, 1, activity="RECHARGING")),
            (online(7, 1), state(7, 1, activity="FLYING", mission_id="msn_2")),
            (online(7, 1), state(7, 1, activity="DOWN")),
            (online(7, 1, "OFFLINE"), state(7, 1)),
            (online(7, 1),),
            (),
        )
    ]

    found = await asked(api)

    counted = dict.fromkeys((one["state"] for one in shown), 0)
    for one in shown:
        counted[one["state"]] += 1
    assert found["by_state"] == counted
    assert found["drones"] == len(shown)
    assert {"AVAILABLE", "RECHARGING", "ON_MISSION", "GROUNDED", "OFFLINE"} <= set(counted)


async def test_silent_drones_are_counted_offline(
    api: Any, db: Database, clock: ManualClock, provider_id: str, online: Maker, state: Maker
) -> None:
    await said(api, db, clock, provider_id, online(7, 1), state(7, 1))
    clock.advance(timedelta(seconds=101))

    assert (await asked(api))["by_state"] == {"OFFLINE": 1}


async def test_lag_is_from_sending_the_newest_message_to_receiving_it(
    api: Any,
    db: Database,
    clock: ManualClock,
    provider_id: str,
    online: Maker,
    state: Maker,
    sample: Maker,
) -> None:
    early, sampled = state(7, 3), sample(7, 5, later_s=2.0)
    clock.advance(timedelta(seconds=6))
    await said(api, db, clock, provider_id, online(7, 1), early)
    await said(api, db, clock, provider_id, online(7, 1), early, sampled)

    found = await asked(api)

    assert (found["lag_mean_s"], found["lag_max_s"]) == (5.0, 6.0)
    assert (found["states"], found["samples"]) == (6, 5)


async def test_a_provider_counts_its_own_drones_only(api: Any, provider_id: str) -> None:
    other = await api.provider()
    await api.drone(other)

    assert (await asked(api, f"provider:{provider_id}"))["drones"] == 0
    assert (await asked(api))["drones"] == 1


async def test_without_drones_the_statistics_are_empty(api: Any) -> None:
    found = await asked(api)

    assert (found["by_state"], found["lag_mean_s"], found["lag_max_s"]) == ({}, None, None)


async def test_customers_may_not_read_the_statistics(api: Any) -> None:
    assert (await api("customer:c1", "GET", "/v1/stats/fleets")).status_code == 403
