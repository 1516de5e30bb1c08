"""Maintenance: counted from what was seen, called for once, and no new missions meanwhile."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from skyway_provider_registry.presence import jump_store
from skyway_provider_registry.presence.jump import Ahead, LastSeen
from skyway_provider_registry.presence.wear import MaintenanceRule, Wear, wear_between

from skyway.contracts.drone_report import DroneState
from skyway.contracts.drones import DroneAlarm
from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneModelId
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from skyway.units import ms_to_moment
from tests.provider_registry.flying_drone import FlyingDrone, fly_drone, make_health

pytestmark = pytest.mark.databases("sqlite")

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]
RULE = f"/maintenance-rules/{MODEL.model_id}"


@pytest.fixture
async def drone(
    api: Any, db: Database, clock: ManualClock, state: Callable[..., DroneState], online: Any
) -> FlyingDrone:
    return await fly_drone(api, db, clock, state, online)


async def put_rule(drone: FlyingDrone, status: int = 200, **limits: object) -> Any:
    answer = await drone.provider_calls("PUT", RULE, limits)
    assert answer.status_code == status, answer.text
    return answer.json()


async def maintenance(drone: FlyingDrone) -> Any:
    return (await drone.call("GET")).json()["maintenance"]


async def alarms(drone: FlyingDrone) -> list[DroneAlarm]:
    async with drone.db.read() as connection:
        return [alarm for alarm, _network in await jump_store.waiting(connection, limit=10)]


async def out_of_service(drone: FlyingDrone) -> Any:
    asked = {"drone_ids": [drone.drone["drone_id"]]}
    path = "/internal/drones-out-of-service"
    return (await drone.api(None, "POST", path, asked, service="composition")).json()


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_drone_that_is_due_gets_no_missions_until_its_maintenance_is_recorded(
    drone: FlyingDrone,
) -> None:
    await put_rule(drone, every_flight_hours=0.2)
    for _ in range(4):
        await drone.flies(make_health(), seconds=300)
    found = await maintenance(drone)
    assert (found["flight_hours"], found["due_since_at"]) == (pytest.approx(0.17, abs=0.01), None)
    await drone.flies(make_health(), seconds=300)
    await drone.reports("ENDED", "COMPLETED")

    (alarm,) = await alarms(drone)
    assert (alarm.code, alarm.level) == ("MAINTENANCE_DUE", "WARNING")
    assert "due every 0.2 h" in alarm.detail
    assert await drone.candidates() == ()
    # The missions that it has stay its own.
    name = drone.drone["drone_id"]
    assert await out_of_service(drone) == {"drone_ids": [], "due_drone_ids": [name]}
    assert (await drone.call("GET")).json()["state"] == "AVAILABLE"
    assert await drone.broken_rules() == []

    answer = await drone.call("POST", "/maintenance")

    assert answer.status_code == 200, answer.text
    done = answer.json()["maintenance"]
    assert (done["flight_hours"], done["cycles"], done["due_since_at"]) == (0.0, 0.0, None)
    assert done["maintained_at"] is not None
    (over,) = await alarms(drone)
    assert (over.code, over.is_over) == ("MAINTENANCE_DUE", True)
    assert len(await drone.candidates()) == 1
    assert await drone.broken_rules() == []


async def test_the_alarm_is_raised_once_each_time_a_drone_becomes_due(drone: FlyingDrone) -> None:
    await put_rule(drone, every_cycles=0.5)
    for _ in range(4):
        await drone.flies(make_health(), soc_after=0.6)
        await drone.charges(soc_after=0.9)
    (alarm,) = await alarms(drone)
    async with drone.db.write() as tx:
        await jump_store.remove_waiting(tx, alarm)
    assert "full charges" in alarm.detail

    await drone.flies(make_health(), soc_after=0.6)

    assert await alarms(drone) == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_rule_counts_for_what_was_flown_before(drone: FlyingDrone, api: Any) -> None:
    for _ in range(4):
        await drone.flies(make_health(), seconds=300)
    await drone.reports("ENDED", "COMPLETED")
    other = (await api.drone(drone.drone["provider_id"]))["drone_id"]

    assert await put_rule(drone, every_flight_hours=0.1) == {
        "model_id": MODEL.model_id,
        "every_flight_hours": 0.1,
        "every_cycles": None,
    }
    assert (await maintenance(drone))["due_since_at"] is not None
    assert await drone.candidates() == ()
    assert [each.drone_id for each in await alarms(drone)] == [drone.drone["drone_id"]]
    assert (await drone.provider_calls("GET", f"/drones/{other}")).json()["maintenance"][
        "due_since_at"
    ] is None
    assert (await drone.provider_calls("GET", "/maintenance-rules")).json()["items"] == [
        {"model_id": MODEL.model_id, "every_flight_hours": 0.1, "every_cycles": None}
    ]
    assert await drone.broken_rules() == []

    await put_rule(drone, every_flight_hours=100.0)
    assert (await maintenance(drone))["due_since_at"] is None
    await put_rule(drone, every_flight_hours=0.1)
    assert (await drone.provider_calls("DELETE", RULE)).status_code == 204

    assert (await maintenance(drone))["due_since_at"] is None
    assert len(await drone.candidates()) == 1
    assert (await drone.provider_calls("DELETE", RULE)).status_code == 404
    assert await drone.broken_rules() == []


@pytest.mark.parametrize(
    "limits",
    [
        {},
        {"every_flight_hours": None, "every_cycles": None},
        {"every_flight_hours": 0},
        {"every_flight_hours": -1},
        {"every_cycles": 0},
        {"every_cycles": 1e9},
        {"every_cycles": "NaN"},
        {"every_day": 1},
    ],
)
async def test_a_bad_rule_is_refused(drone: FlyingDrone, limits: dict[str, object]) -> None:
    await put_rule(drone, 422, **limits)

    assert (await drone.provider_calls("GET", "/maintenance-rules")).json()["items"] == []


async def test_providers_maintain_only_their_own_fleet(drone: FlyingDrone, api: Any) -> None:
    other = await api.provider()
    own = f"/v1/providers/{drone.drone['provider_id']}"
    unknown = await drone.provider_calls("PUT", "/maintenance-rules/pigeon", {"every_cycles": 5})

    assert unknown.status_code == 422
    for method, path, body in (
        ("GET", "/maintenance-rules", None),
        ("PUT", RULE, {"every_cycles": 5}),
        ("DELETE", RULE, None),
        ("POST", f"/drones/{drone.drone['drone_id']}/maintenance", None),
    ):
        answer = await api(f"provider:{other}", method, own + path, body)
        assert answer.status_code == 404, answer.text


async def test_a_state_that_comes_again_counts_once(drone: FlyingDrone) -> None:
    landed = await drone.flies(make_health(), soc_after=0.5)
    counted = await maintenance(drone)
    for _ in range(3):
        drone.clock.advance(timedelta(seconds=30))
        await drone.sends(landed)

    assert await maintenance(drone) == counted
    assert counted["cycles"] == pytest.approx(0.4)


@given(
    activity=st.sampled_from(["FLYING", "IDLE", "RECHARGING", "DOWN"]),
    socs=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    passed_s=st.floats(-1e6, 1e8),
    has_other_battery=st.booleans(),
)
def test_no_state_adds_more_than_time_and_a_battery_allow(
    activity: str, socs: tuple[float, float], passed_s: float, has_other_battery: bool
) -> None:
    place, now = Position(0.0, 0.0), ms_to_moment(1_900_000_000_000)
    before = LastSeen(
        session=1,
        seq=1,
        sample_order=(1, 1),
        received_at=now - timedelta(seconds=passed_s),
        position=place,
        soc=socs[0],
        ahead=Ahead(),
        model=MODEL,
        activity=activity,
        has_other_battery=has_other_battery,
    )
    after = DroneState(
        message_id="m",
        sent_at=now,
        session=1,
        seq=2,
        at=now,
        activity="IDLE",
        stream=0,
        last_instruction_seq=0,
        last_event_seq=0,
        position=place,
        soc=socs[1],
    )

    wear = wear_between(before, after, received_at=now)

    longest_s = MODEL.battery_j / MODEL.power_empty_w
    assert 0 <= wear.flown_s <= min(max(0.0, passed_s) + 1e-6, longest_s)
    assert wear.flown_s == 0 or activity == "FLYING"
    assert 0 <= wear.used_soc <= max(0.0, socs[0] - socs[1])
    assert not (has_other_battery and wear.used_soc)


def test_the_reason_names_each_limit_that_was_reached() -> None:
    rule = MaintenanceRule(every_flight_hours=10, every_cycles=5)

    assert rule.why_due(Wear(35_999, 4.9)) is None
    assert rule.why_due(Wear(36_000, 4.9)) == "it has flown 10.0 h, and is due every 10 h"
    assert rule.why_due(Wear(1.0, 5.25)) == "it has used 5.2 full charges, and is due every 5"
