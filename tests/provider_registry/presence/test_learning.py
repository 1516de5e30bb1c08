"""What flights show about a drone: learned slowly, once, within bounds; forgotten on request."""

from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_provider_registry.presence import jump_store
from skyway_provider_registry.presence.follow import Recorder
from skyway_provider_registry.presence.learning import Learned, why_maintenance

from skyway.contracts.drone_report import DroneState
from skyway.contracts.topics import STATE
from skyway.drone.learned_values import AS_MODELLED, LearnedValues
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database
from tests.provider_registry.flying_drone import FlyingDrone, fly_drone, make_health

pytestmark = pytest.mark.databases("sqlite")


def flown(uses: Sequence[float], *, health: float = 1.0) -> Learned:
    learned = Learned()
    for use in uses:
        learned = learned.after_flight(make_health(use=use, health=health))
    return learned


def test_a_drone_that_is_as_its_model_stays_so() -> None:
    planned = flown([1.01, 0.98, 1.02, 0.99] * 10).planned

    assert planned.model_copy(update={"still_air_deviation": 0.08}) == AS_MODELLED


def test_the_energy_use_of_a_drone_counts_as_widely_spread_until_it_has_flown_much() -> None:
    steady, varied = [1.0, 1.02, 0.98] * 7, [1.0, 1.15, 0.85] * 7

    deviations = [
        flown(uses).planned.still_air_deviation
        for uses in ([], steady[:2], steady[:19], steady[:20], varied[:2], varied, [1.3] * 3)
    ]

    # The last drone is far from its model, and nobody knows yet by how much.
    assert deviations == [0.08, 0.08, 0.08, 0.04, 0.1, 0.14, 0.18]


def test_a_drone_that_uses_more_energy_is_planned_so_after_some_flights() -> None:
    planned = [flown([1.12] * flights).planned.still_air_factor for flights in (1, 5, 20)]

    assert planned == [1.05, 1.1, 1.1]


def test_a_worn_battery_and_slow_charging_are_learned() -> None:
    learned = flown([1.0] * 3, health=0.88)
    for _ in range(4):
        learned = learned.after_recharge(make_health(health=0.88, charging=0.8))

    assert learned.planned == LearnedValues(state_of_health=0.9, charge_rate_factor=0.85)


def test_a_drone_is_planned_as_better_than_its_model_only_after_many_flights() -> None:
    assert flown([0.8] * 19).planned.still_air_factor == 1.0
    assert flown([0.8] * 20).planned.still_air_factor == pytest.approx(0.85)


def test_one_odd_flight_changes_hardly_anything() -> None:
    usual = [1.1] * 20
    as_usual = flown(usual).planned

    for odd in (900.0, 0.001):
        planned = flown([*usual, odd]).planned
        # Its energy use counts as no more spread than that of a new drone.
        assert planned == as_usual.model_copy(update={"still_air_deviation": 0.08})


@settings(max_examples=50)
@given(
    reports=st.lists(
        st.tuples(st.floats(1e-6, 1e3), st.floats(0, 1), st.floats(1e-6, 1e3)), max_size=60
    )
)
def test_no_report_leads_out_of_the_bounds(reports: list[tuple[float, float, float]]) -> None:
    learned = Learned()
    for use, health, charging in reports:
        report = make_health(use=use, health=health, charging=charging)
        learned = learned.after_flight(report).after_recharge(report)

    planned = learned.planned

    assert LearnedValues.model_validate(planned.model_dump()) == planned
    assert learned.flights == learned.recharges == len(reports)


def test_maintenance_is_due_once_until_the_drone_is_clearly_better() -> None:
    health = {use: make_health(use=use) for use in (1.0, 1.25, 1.35)}
    learned, reasons = flown([1.6] * 6), 0
    for use in [1.35] * 10 + [1.25, 1.35] * 50:
        before, learned = learned, learned.after_flight(health[use])
        reasons += why_maintenance(before, learned) is not None
    assert (reasons, learned.is_maintenance_due) == (1, True)

    for use in [1.0] * 20:
        before, learned = learned, learned.after_flight(health[use])
        assert why_maintenance(before, learned) is None
    assert not learned.is_maintenance_due


@pytest.fixture
async def drone(
    api: Any, db: Database, clock: ManualClock, state: Callable[..., DroneState], online: Any
) -> FlyingDrone:
    return await fly_drone(api, db, clock, state, online)


@pytest.mark.databases("sqlite", "postgresql")
async def test_what_flights_show_is_shown_planned_with_and_forgotten_on_request(
    drone: FlyingDrone,
) -> None:
    assert await drone.learned() is None

    for _ in range(5):
        await drone.flies(make_health(use=1.1, health=0.88))
    await drone.reports("ENDED", "COMPLETED")

    shown = await drone.learned()
    assert (shown["flights"], shown["recharges"]) == (5, 0)
    assert shown["still_air_factor"] == pytest.approx(1.0625, abs=1e-3)
    assert await drone.planned() == LearnedValues(still_air_factor=1.05, state_of_health=0.9)
    assert LearnedValues.model_validate(shown["planned"]) == await drone.planned()
    assert await drone.broken_rules() == []

    answer = await drone.call("DELETE", "/learned-values")

    assert answer.status_code == 204, answer.text
    assert await drone.learned() is None
    assert await drone.planned() == AS_MODELLED


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_batch_teaches_about_each_drone_that_flew_its_own_mission(
    api: Any, db: Database, clock: ManualClock, state: Callable[..., DroneState], online: Any
) -> None:
    missions = ("msn_1", "msn_2")
    own = [await fly_drone(api, db, clock, state, online, mission_id=each) for each in missions]
    # Its report comes late: the mission is another drone's already.
    pretender = await fly_drone(api, db, clock, state, online, mission_id="msn_2")
    drones, batch = (*own, pretender), []
    for number, each in enumerate(drones):
        flight = {"mission_id": each.mission_id, "health": make_health(use=1.1 + 0.1 * number)}
        await each.does("FLYING", after_s=150, soc=0.9, **flight)
        batch.append(state(7, 3, activity="WAITING", soc=0.9, **flight))
    clock.advance(timedelta(seconds=300))

    await Recorder(db, clock).record(
        [
            Received(STATE, (each.drone["provider_id"], each.drone["drone_id"]), landed, False)
            for each, landed in zip(drones, batch, strict=True)
        ]
    )

    first, second, none = [await each.learned() for each in drones]
    assert (first["flights"], second["flights"], none) == (1, 1, None)
    assert first["still_air_factor"] < second["still_air_factor"]


async def test_a_drone_that_becomes_much_worse_raises_an_alarm_for_maintenance_once(
    drone: FlyingDrone,
) -> None:
    for _ in range(8):
        await drone.flies(make_health(use=1.6))

    async with drone.db.read() as connection:
        (alarm, _network), *others = await jump_store.waiting(connection, limit=10)
    assert others == []
    assert (alarm.code, alarm.level) == ("MAINTENANCE_DUE", "WARNING")
    assert "1.27 times the energy" in alarm.detail
    assert (await drone.call("GET")).json()["state"] != "MAINTENANCE"


async def test_a_landing_counts_once_however_often_it_is_read(drone: FlyingDrone) -> None:
    landed = await drone.flies(make_health(use=1.1))
    await drone.sends(landed)
    await drone.sends(landed)

    assert (await drone.learned())["flights"] == 1


async def test_flights_without_a_mission_of_composition_do_not_count(drone: FlyingDrone) -> None:
    await drone.flies(make_health(use=0.8), mission_id="msn_of_its_own")

    assert await drone.learned() is None


async def test_a_drone_cannot_report_20_flights_within_seconds(drone: FlyingDrone) -> None:
    for _ in range(20):
        await drone.flies(make_health(use=0.8), seconds=2)
    assert (await drone.learned())["flights"] == 1

    await drone.flies(make_health(use=0.8), seconds=60)
    assert (await drone.learned())["flights"] == 2


async def test_flights_for_a_mission_that_is_over_do_not_count(drone: FlyingDrone) -> None:
    await drone.reports("ENDED", "COMPLETED")
    # The last landing of the mission, after composition has reported the end.
    await drone.flies(make_health(use=1.1), seconds=20)
    for _ in range(3):
        await drone.flies(make_health(use=0.8))

    assert (await drone.learned())["flights"] == 1


async def test_a_drone_that_measures_nothing_is_planned_by_its_model(drone: FlyingDrone) -> None:
    await drone.flies(make_health(use=None, health=0.7))

    assert await drone.learned() is None


async def test_only_the_own_provider_may_reset_what_was_learned(
    drone: FlyingDrone, api: Any
) -> None:
    await drone.flies(make_health(use=1.1))
    path = f"/v1/providers/{drone.drone['provider_id']}/drones/{drone.drone['drone_id']}"

    for caller, status in (("provider:prv_other", 404), (f"drone:{drone.drone['drone_id']}", 403)):
        answer = await api(caller, "DELETE", f"{path}/learned-values")
        assert answer.status_code == status, answer.text

    assert (await drone.learned())["flights"] == 1
