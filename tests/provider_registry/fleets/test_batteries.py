"""Batteries as things: each is in one drone at most, and keeps what was learned about it."""

import random
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.fleets.battery import MOST_INSTALLATIONS
from skyway_provider_registry.presence import jump_store
from skyway_verifier.registry.rules import RULES

from skyway.contracts.drone_report import DroneState
from skyway.drone.learned_values import AS_MODELLED
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.provider_registry.flying_drone import FlyingDrone, fly_drone, make_health

pytestmark = pytest.mark.databases("sqlite")

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]


@pytest.fixture
async def drone(
    api: Any, db: Database, clock: ManualClock, state: Callable[..., DroneState], online: Any
) -> FlyingDrone:
    return await fly_drone(api, db, clock, state, online)


async def register(drone: FlyingDrone, serial: str, **members: object) -> str:
    """The id of a new battery."""
    body = {"serial": serial, "model_id": MODEL.model_id, **members}
    answer = await drone.provider_calls("POST", "/batteries", body)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["battery_id"])


async def shown(drone: FlyingDrone, battery_id: str) -> Any:
    return (await drone.provider_calls("GET", f"/batteries/{battery_id}")).json()


async def install(drone: FlyingDrone, battery_id: str, status: int = 200) -> Any:
    answer = await drone.call("PUT", "/battery", {"battery_id": battery_id})
    assert answer.status_code == status, answer.text
    return answer.json()


@pytest.mark.databases("sqlite", "postgresql")
async def test_health_and_cycles_go_with_the_battery(
    drone: FlyingDrone, clock: ManualClock
) -> None:
    await drone.reports("ENDED", "COMPLETED")
    worn, fresh = await register(drone, "S-1"), await register(drone, "S-2")
    assert (await install(drone, worn))["battery_id"] == worn
    await drone.reports("ACCEPTED", "ACCEPTED")
    for _ in range(5):
        await drone.flies(make_health(use=1.0, health=0.8), soc_after=0.7)
        await drone.charges(soc_after=0.9)
    await drone.reports("ENDED", "COMPLETED")
    assert (await drone.planned()).state_of_health == pytest.approx(0.85)

    await install(drone, fresh)

    assert await drone.planned() == AS_MODELLED
    old = await shown(drone, worn)
    assert (old["drone_id"], old["installed_at"]) == (None, None)
    assert old["cycles"] == pytest.approx(1.0)
    assert old["state_of_health"] == pytest.approx(0.8, abs=0.05)
    (past,) = old["past_installations"]
    assert (past["drone_id"], past["cycles"]) == (drone.drone["drone_id"], old["cycles"])
    assert (await shown(drone, fresh))["cycles"] == 0
    wall_at = clock.wall_now()
    assert await broken_rules(drone.db, RULES, wall_at=wall_at, fleet_at=clock.now()) == []

    # The drone is planned with the worn battery again as soon as it has it again.
    clock.advance(timedelta(seconds=10))
    await install(drone, worn)
    assert (await drone.planned()).state_of_health == pytest.approx(0.85)


async def test_a_change_of_battery_forgets_the_health_of_an_unknown_battery(
    drone: FlyingDrone,
) -> None:
    for _ in range(5):
        await drone.flies(make_health(use=1.1, health=0.8))
    await drone.reports("ENDED", "COMPLETED")
    assert (await drone.planned()).state_of_health == pytest.approx(0.85)
    battery = await register(drone, "S-1", capacity_j=MODEL.battery_j * 0.9)

    await install(drone, battery)
    assert (await drone.planned()).state_of_health == pytest.approx(0.9)
    assert (await drone.call("DELETE", "/battery")).json()["battery_id"] is None

    assert (await drone.planned()).state_of_health == 1.0
    assert (await drone.learned())["still_air_factor"] > 1.05
    assert (await drone.call("DELETE", "/battery")).status_code == 404


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_battery_in_another_drone_is_refused_by_name(drone: FlyingDrone, api: Any) -> None:
    await drone.reports("ENDED", "COMPLETED")
    battery = await register(drone, "S-1")
    await install(drone, battery)
    other = (await api.drone(drone.drone["provider_id"]))["drone_id"]

    answer = await drone.provider_calls("PUT", f"/drones/{other}/battery", {"battery_id": battery})
    deleted = await drone.provider_calls("DELETE", f"/batteries/{battery}")

    for refused in (answer, deleted):
        assert refused.status_code == 409, refused.text
        assert refused.json()["code"] == "BATTERY_INSTALLED"
        assert drone.drone["drone_id"] in refused.json()["detail"]
        assert "S-1" in refused.json()["detail"]
    assert (await shown(drone, battery))["drone_id"] == drone.drone["drone_id"]
    # The same installation once more changes nothing.
    await install(drone, battery)
    assert (await shown(drone, battery))["past_installations"] == []


async def test_a_battery_is_not_changed_during_a_mission(drone: FlyingDrone) -> None:
    first, second = await register(drone, "S-1"), await register(drone, "S-2")

    assert (await install(drone, first, 409))["code"] == "ON_MISSION"
    await drone.reports("ENDED", "COMPLETED")
    await install(drone, first)
    await drone.flies(make_health(use=1.0), mission_id="msn_of_its_own")

    assert (await install(drone, second, 409))["code"] == "ON_MISSION"
    assert (await drone.call("DELETE", "/battery")).json()["code"] == "ON_MISSION"


async def test_another_charge_after_a_change_is_no_jump_and_no_use(drone: FlyingDrone) -> None:
    await drone.reports("ENDED", "COMPLETED")
    await drone.rests(soc=0.2)
    used = (await drone.call("GET")).json()["maintenance"]["cycles"]
    await install(drone, await register(drone, "S-1"))
    drone.clock.advance(timedelta(seconds=40))
    await drone.rests(soc=1.0)
    await install(drone, await register(drone, "S-2"))
    drone.clock.advance(timedelta(seconds=40))
    await drone.rests(soc=0.3)

    found = (await drone.call("GET")).json()
    assert (found["state"], found["maintenance"]["cycles"]) == ("AVAILABLE", used)

    # Without a change it is one.
    drone.clock.advance(timedelta(seconds=40))
    await drone.rests(soc=1.0)
    async with drone.db.read() as connection:
        ((alarm, _network),) = await jump_store.waiting(connection, limit=10)
    assert alarm.code == "DRONE_JUMPED"


@pytest.mark.parametrize("late_s", [0.0, 86_400.0])
async def test_a_late_clock_does_not_make_each_charge_that_of_another_battery(
    drone: FlyingDrone, late_s: float
) -> None:
    await drone.reports("ENDED", "COMPLETED")
    await install(drone, await register(drone, "S-1"))
    for _ in range(2):
        at = drone.clock.now() - timedelta(seconds=late_s)
        await drone.does("IDLE", after_s=100.0, soc=0.3, at=at)
    used = (await drone.call("GET")).json()["maintenance"]["cycles"]

    at = drone.clock.now() - timedelta(seconds=late_s)
    await drone.does("IDLE", after_s=10.0, soc=0.1, at=at)
    assert (await drone.call("GET")).json()["maintenance"]["cycles"] == pytest.approx(used + 0.2)
    await drone.does("IDLE", after_s=10.0, soc=1.0, at=at)

    async with drone.db.read() as connection:
        ((alarm, _network),) = await jump_store.waiting(connection, limit=10)
    assert alarm.code == "DRONE_JUMPED"


async def test_a_removed_drone_frees_its_battery(drone: FlyingDrone) -> None:
    await drone.reports("ENDED", "COMPLETED")
    battery = await register(drone, "S-1")
    await install(drone, battery)
    drone.clock.advance(timedelta(hours=1))

    assert (await drone.call("DELETE")).status_code == 204

    found = await shown(drone, battery)
    assert found["drone_id"] is None
    assert [each["drone_id"] for each in found["past_installations"]] == [drone.drone["drone_id"]]
    assert (await drone.provider_calls("DELETE", f"/batteries/{battery}")).status_code == 204
    assert (await drone.provider_calls("GET", f"/batteries/{battery}")).status_code == 404


@pytest.mark.long
async def test_only_the_newest_past_installations_are_kept(drone: FlyingDrone) -> None:
    await drone.reports("ENDED", "COMPLETED")
    battery = await register(drone, "S-1")
    for _ in range(MOST_INSTALLATIONS + 2):
        await install(drone, battery)
        drone.clock.advance(timedelta(minutes=1))
        assert (await drone.call("DELETE", "/battery")).status_code == 200

    past = (await shown(drone, battery))["past_installations"]
    moments = [each["installed_at"] for each in past]
    assert len(past) == MOST_INSTALLATIONS
    assert moments == sorted(moments, reverse=True)
    assert await drone.broken_rules() == []


@pytest.mark.parametrize(
    ("members", "field"),
    [
        ({"serial": ""}, "serial"),
        ({"serial": "x" * 65}, "serial"),
        ({"serial": "two\nlines"}, "serial"),
        ({"serial": None}, "serial"),
        ({"model_id": "pigeon"}, "model_id"),
        ({"capacity_j": 0}, "capacity_j"),
        ({"capacity_j": -5.0}, "capacity_j"),
        ({"capacity_j": 1e300}, "capacity_j"),
        ({"capacity_j": MODEL.battery_j * 0.49}, "capacity_j"),
        ({"drone_id": "drn_000001"}, "drone_id"),
    ],
)
async def test_a_bad_battery_is_refused_by_its_field(
    drone: FlyingDrone, members: dict[str, object], field: str
) -> None:
    body = {"serial": "S-1", "model_id": MODEL.model_id, **members}

    answer = await drone.provider_calls("POST", "/batteries", body)

    assert answer.status_code == 422, answer.text
    assert field in answer.text
    assert (await drone.provider_calls("GET", "/batteries")).json()["items"] == []


async def test_serials_models_and_owners_are_checked(drone: FlyingDrone, api: Any) -> None:
    await drone.reports("ENDED", "COMPLETED")
    battery = await register(drone, "S-1")
    again = await drone.provider_calls(
        "POST", "/batteries", {"serial": "S-1", "model_id": MODEL.model_id}
    )
    other_model = await register(drone, "S-2", model_id="dji-matrice-300-rtk")
    other = await api.provider()

    assert (again.status_code, again.json()["code"]) == (409, "SERIAL_TAKEN")
    assert (await install(drone, other_model, 409))["code"] == "OTHER_MODEL"
    assert (await install(drone, "bat_absent", 404))["title"]
    own = f"/v1/providers/{drone.drone['provider_id']}"
    for path in ("/batteries", f"/batteries/{battery}"):
        assert (await api(f"provider:{other}", "GET", own + path)).status_code == 404
    foreign = await api.drone(other)
    answer = await api(
        f"provider:{other}",
        "PUT",
        f"/v1/providers/{other}/drones/{foreign['drone_id']}/battery",
        {"battery_id": battery},
    )
    assert answer.status_code == 404
    # Another provider may have the same serial number.
    body = {"serial": "S-1", "model_id": MODEL.model_id}
    answer = await api(f"provider:{other}", "POST", f"/v1/providers/{other}/batteries", body)
    assert answer.status_code == 201


async def test_batteries_are_listed_in_pages(drone: FlyingDrone) -> None:
    made = sorted([await register(drone, f"S-{number}") for number in range(3)])

    first = (await drone.provider_calls("GET", "/batteries?limit=2")).json()
    cursor = first["next_cursor"]
    second = (await drone.provider_calls("GET", f"/batteries?limit=2&cursor={cursor}")).json()

    assert [each["battery_id"] for each in first["items"] + second["items"]] == made
    assert second["next_cursor"] is None


@pytest.mark.parametrize("seed", range(3))
async def test_however_batteries_are_moved_each_is_in_one_drone_at_most(
    drone: FlyingDrone, api: Any, seed: int
) -> None:
    await drone.reports("ENDED", "COMPLETED")
    provider_id, chance = drone.drone["provider_id"], random.Random(seed)
    drones = [drone.drone["drone_id"], (await api.drone(provider_id))["drone_id"]]
    batteries = [await register(drone, f"S-{number}") for number in range(3)]
    expected: dict[str, str] = {}

    for _ in range(25):
        drone.clock.advance(timedelta(seconds=chance.choice([0, 40])))
        drone_id, battery_id = chance.choice(drones), chance.choice(batteries)
        path = f"/drones/{drone_id}/battery"
        if chance.random() < 0.3:
            answer = await drone.provider_calls("DELETE", path)
            assert (answer.status_code == 200) == (drone_id in expected)
            expected.pop(drone_id, None)
            continue
        answer = await drone.provider_calls("PUT", path, {"battery_id": battery_id})
        is_elsewhere = battery_id in {expected[each] for each in expected.keys() - {drone_id}}
        assert answer.status_code == (409 if is_elsewhere else 200), answer.text
        if not is_elsewhere:
            expected[drone_id] = battery_id

    rows = (await drone.provider_calls("GET", "/batteries")).json()["items"]
    found = {each["drone_id"]: each["battery_id"] for each in rows if each["drone_id"]}
    assert found == expected
    assert await drone.broken_rules() == []
