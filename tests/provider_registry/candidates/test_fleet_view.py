"""The fleets in memory are those that any replica has committed."""

import asyncio
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import pytest
from skyway_provider_registry.candidates.fleet_view import FleetView
from skyway_provider_registry.candidates.reasons import CachedDrone
from skyway_provider_registry.presence.follow import Recorder

from skyway.announced_networks import CachedNetworks
from skyway.contracts.drone_report import Connection, DroneState
from skyway.contracts.topics import CONNECTION, STATE
from skyway.drone.models import PAPER_SCENARIO
from skyway.geo import Position
from skyway.ids import MissionId, StationId
from skyway.runtime.clock import ManualClock
from skyway.runtime.loops import Pace
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

AT = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture
def view(db: Database) -> FleetView:
    """The view of a second replica; the tests call the first."""
    return FleetView(db, CachedNetworks(), Pace())


def batch_of(drone: dict[str, Any], *, seq: int = 1, mission: str | None = None) -> list[Any]:
    ids = (drone["provider_id"], drone["drone_id"])
    online = Connection(message_id="m", sent_at=AT, session=1, connection_number=1, status="ONLINE")
    state = DroneState(
        message_id="m",
        sent_at=AT,
        session=1,
        seq=seq,
        at=AT,
        activity="IDLE",
        stream=0,
        last_instruction_seq=0,
        last_event_seq=0,
        station_id=StationId("mcqueeney"),
        mission_id=None if mission is None else MissionId(mission),
        position=Position(-98.0, 29.6),
        soc=0.7,
    )
    return [Received(CONNECTION, ids, online, False), Received(STATE, ids, state, False)]


async def drones(view: FleetView) -> Sequence[CachedDrone]:
    return (await view.refreshed()).columns.drones


async def test_a_new_drone_is_cached_at_home_and_offline(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    assert await drones(view) == []

    made = await api.drone(provider_id, soc=0.6)

    (drone,) = await drones(view)
    assert (drone.drone_id, drone.station_id, drone.soc) == (made["drone_id"], None, 0.6)
    assert drone.online_until_ms == 0


async def test_messages_that_one_replica_received_are_seen_by_the_others(
    api: Any, view: FleetView, db: Database, clock: ManualClock
) -> None:
    made = await api.drone(await api.provider())
    await view.refreshed()

    await Recorder(db, clock).record(batch_of(made, mission="msn_1"))

    (drone,) = await drones(view)
    assert (drone.station_id, drone.soc, drone.is_busy) == ("mcqueeney", 0.7, True)
    assert drone.online_until_ms > 0


async def test_a_mission_report_makes_a_drone_busy_and_free_again(
    api: Any, view: FleetView, db: Database, clock: ManualClock
) -> None:
    made = await api.drone(await api.provider())
    await Recorder(db, clock).record(batch_of(made, mission="msn_1"))
    report = {
        "report_id": "r",
        "delivery_id": "dlv_1",
        "attempt": 1,
        "trip": 1,
        "mission_id": "msn_1",
        "drone_id": made["drone_id"],
        "provider_id": made["provider_id"],
        "at": "2026-03-01T12:00:00Z",
    }
    seen = []
    for seq, kind, state in ((1, "ACCEPTED", "ACCEPTED"), (2, "ENDED", "COMPLETED")):
        body = {**report, "seq": seq, "kind": kind, "mission_state": state}
        answer = await api(None, "POST", "/internal/mission-reports", body, service="composition")
        assert answer.status_code == 204, answer.text
        seen += [drone.is_busy for drone in await drones(view)]

    assert seen == [True, False]


@pytest.mark.parametrize(
    ("flies", "place"), [(False, ("mcqueeney", 0.7, 0)), (True, ("seguin", 0.5, 1_772_388_000_000))]
)
async def test_a_drone_stands_where_its_missions_leave_it_only_while_it_flies(
    api: Any,
    view: FleetView,
    db: Database,
    clock: ManualClock,
    flies: bool,
    place: tuple[str, float, int],
) -> None:
    """An idle drone can fly before the missions that wait for later."""
    made = await api.drone(await api.provider())
    await Recorder(db, clock).record(batch_of(made, mission="msn_1" if flies else None))
    report = {
        "report_id": "r",
        "delivery_id": "dlv_2",
        "attempt": 1,
        "trip": 1,
        "mission_id": "msn_2",
        "drone_id": made["drone_id"],
        "provider_id": made["provider_id"],
        "at": "2026-03-01T12:00:00Z",
        "seq": 1,
        "kind": "QUEUED",
        "mission_state": "QUEUED",
        "free_from": {"at": "2026-03-01T18:00:00Z", "station_id": "seguin", "soc": 0.5},
    }

    answer = await api(None, "POST", "/internal/mission-reports", report, service="composition")

    assert answer.status_code == 204, answer.text
    (drone,) = await drones(view)
    assert (drone.station_id, drone.soc, drone.free_ms) == place


async def test_maintenance_is_seen_by_the_other_replicas_immediately(
    api: Any, view: FleetView, db: Database, clock: ManualClock
) -> None:
    made = await api.drone(await api.provider())
    await Recorder(db, clock).record(batch_of(made))
    path = f"/v1/providers/{made['provider_id']}/drones/{made['drone_id']}"
    await view.refreshed()

    await api("operator:op", "PATCH", path, {"state": "MAINTENANCE"})

    assert [drone.online_until_ms for drone in await drones(view)] == [0]


async def test_a_removed_drone_is_gone_for_the_other_replicas(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    first, second = await api.drone(provider_id), await api.drone(provider_id)
    await view.refreshed()

    path = f"/v1/providers/{provider_id}/drones/{first['drone_id']}"
    await api("operator:op", "DELETE", path)

    assert [drone.drone_id for drone in await drones(view)] == [second["drone_id"]]


async def test_a_changed_provider_is_seen_by_the_other_replicas(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    await view.refreshed()

    change = {"state": "SUSPENDED", "loading": "CONFIRMED", "tariff": {"base": 7}}
    await api("operator:op", "PATCH", f"/v1/providers/{provider_id}", change)

    (provider,) = (await view.refreshed()).providers.values()
    assert (provider.is_active, provider.loading, provider.tariff.base) == (False, "CONFIRMED", 7)


async def test_a_changed_standby_is_seen_by_the_other_replicas(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    drone = await api.drone(provider_id)
    await view.refreshed()

    await api("operator:op", "PATCH", f"/v1/providers/{provider_id}", {"standby": "STAY"})
    path = f"/v1/providers/{provider_id}/drones/{drone['drone_id']}"
    await api("operator:op", "PATCH", path, {"standby": "PARKING"})

    fleet = await view.refreshed()
    assert [provider.standby for provider in fleet.providers.values()] == ["STAY"]
    assert [each.standby for each in fleet.columns.drones] == ["PARKING"]


async def test_a_model_that_was_added_later_is_found(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    await view.refreshed()
    model = PAPER_SCENARIO.model_copy(update={"model_id": "added", "max_payload_kg": 40.0})
    body = model.model_dump(mode="json")
    answer = await api("operator:op", "PUT", "/v1/drone-models/added", body)
    assert answer.is_success, answer.text

    await api.drone(provider_id, model_id="added")

    assert [drone.model.max_payload_kg for drone in await drones(view)] == [40.0]


async def test_a_model_that_was_replaced_before_its_first_drone_is_the_new_one(
    api: Any, view: FleetView
) -> None:
    provider_id = await api.provider()
    for limit_kg in (40.0, 50.0):
        changed = {"model_id": "added", "max_payload_kg": limit_kg}
        body = PAPER_SCENARIO.model_copy(update=changed).model_dump(mode="json")
        await api("operator:op", "PUT", "/v1/drone-models/added", body)
        made = await api.drone(provider_id, model_id="added")
        seen = [drone.model.max_payload_kg for drone in await drones(view)]
        path = f"/v1/providers/{provider_id}/drones/{made['drone_id']}"
        await api("operator:op", "DELETE", path)

    assert seen == [50.0]


async def test_simultaneous_refreshes_all_see_earlier_writes(api: Any, view: FleetView) -> None:
    provider_id = await api.provider()
    early = asyncio.create_task(view.refreshed())
    made = [await api.drone(provider_id) for _ in range(3)]

    looks = await asyncio.gather(*(drones(view) for _ in range(5)))

    await early
    expected = sorted(drone["drone_id"] for drone in made)
    assert [sorted(drone.drone_id for drone in look) for look in looks] == [expected] * 5


async def test_the_fleets_stay_as_they_are_while_they_are_used(
    api: Any, db: Database, view: FleetView
) -> None:
    provider_id = await api.provider()
    await api.drone(provider_id)

    async with view.unchanged() as fleet:
        await api.drone(provider_id)
        refreshing = asyncio.ensure_future(view.refreshed())
        # Other replicas read the same changes meanwhile.
        others = [await drones(FleetView(db, CachedNetworks(), Pace())) for _ in range(3)]
        number = len(fleet.columns.drones)

    assert [len(each) for each in others] == [2, 2, 2]
    assert number == 1
    assert len((await refreshing).columns.drones) == 2
