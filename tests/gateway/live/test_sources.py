"""What customers, providers and operators see of drones, missions and deliveries."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import httpx
import pytest
from skyway_gateway.live.picture import Key, Picture
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.sources import Deliveries, Drones, World, show_customers_drones

from skyway.contracts.live import LIVE_MISSIONS, LIVE_WORLD, LiveDrones, LiveMission, LiveWorld
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import Caller
from tests.gateway.whole_gateway import Gateway

AT = "2026-03-01T12:00:00Z"


@dataclass
class Fleet:
    """A registry with one drone, and composition with one mission of it."""

    delivery_id: str = "dlv_1"
    drone: dict[str, Any] = field(default_factory=dict)
    mission: dict[str, Any] = field(default_factory=dict)
    missions: list[dict[str, str]] = field(default_factory=list)
    is_whole: bool = True
    is_away: bool = False
    calls: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.drone = {
            "drone_id": "drn_1",
            "provider_id": "prv_1",
            "model_id": "paper-scenario",
            "state": "ON_MISSION",
            "activity": "FLYING",
            "at": AT,
            "position": [-97.94139, 29.88327],
            "soc": 0.9,
            "mission_id": "msn_1",
            "must_land_at": AT,
        }
        self.mission = {
            "mission_id": "msn_1",
            "delivery_id": self.delivery_id,
            "provider_id": "prv_1",
            "drone_id": "drn_1",
            "state": "ACTIVE",
            "revision": 1,
            "packages": [{"package_id": "p1", "eta_at": AT}],
            "is_carrying": True,
            "service_steps": 3,
            "steps": [
                _step(1, "PICK_UP", "ENDED", package_ids=["p1"]),
                _step(2, "FLY", "PLANNED", station_id="kyle", lands=True),
                _step(3, "DELIVER", "PLANNED", package_ids=["p1"]),
                _step(4, "FLY", "PLANNED", station_id="home", lands=True),
            ],
        }
        self.missions = [{"mission_id": "msn_1", "version": "1"}]

    def client(self, service: str) -> ServiceClient:
        identity: Any = _NoIdentity()
        return ServiceClient(service, f"http://{service}", identity, transport=self._transport())

    def _transport(self) -> httpx.MockTransport:
        async def answer(request: httpx.Request) -> httpx.Response:
            if self.is_away:
                raise httpx.ConnectError("away")
            self.calls.append(f"{request.method} {request.url.raw_path.decode()}")
            return httpx.Response(200, json=self._body(request.url.path))

        return httpx.MockTransport(answer)

    def _body(self, path: str) -> Any:
        if path == LIVE_WORLD:
            return LiveWorld.model_validate(
                {
                    "missions": self.missions,
                    "stations": [],
                    "closures": [],
                    "alarms": [],
                    "open_alarms": 0,
                }
            ).model_dump(mode="json", exclude_none=True)
        if path == LIVE_MISSIONS:
            mission = LiveMission.model_validate(self.mission)
            return {"missions": [mission.model_dump(mode="json", exclude_none=True)]}
        return LiveDrones.model_validate(
            {"mark": "4.0.9", "is_whole": self.is_whole, "drones": [self.drone]}
        ).model_dump(mode="json", exclude_none=True)


class _NoIdentity:
    """The identity of a service without a secret."""

    def headers(self, _caller: object) -> dict[str, str]:
        return {}


def _step(step_id: int, kind: str, status: str, **members: Any) -> dict[str, Any]:
    return {
        "step_id": step_id,
        "kind": kind,
        "status": status,
        "station_id": "san-marcos",
        "position": [-97.9, 29.8],
        "start_at": AT,
        "end_at": AT,
        **members,
    }


def shown(picture: Picture, role: str, subject_id: str) -> dict[str, set[str]]:
    """The ids of what a caller sees, by kind."""
    scope = Scope.of(Caller(role, subject_id), kinds=None, bbox=None)  # type: ignore[arg-type]
    found: dict[str, set[str]] = {}
    for key in scope.part_of(picture):
        found.setdefault(key.kind, set()).add(key.item_id)
    return found


async def read(fleet: Fleet, gateway: Gateway, picture: Picture) -> None:
    """One look at all three sources."""
    async with fleet.client("composition") as composition, fleet.client("registry") as registry:
        for source in (
            Deliveries(gateway.parts.db),
            World(lambda: {"composition": composition}, gateway.parts.db),
            Drones(registry),
        ):
            await source.read(picture)
    show_customers_drones(picture)
    picture.tick()


@pytest.fixture
async def fleet(gateway: Gateway) -> Fleet:
    return Fleet(await gateway.accepted())


async def test_each_role_sees_its_own_part(gateway: Gateway, fleet: Fleet) -> None:
    picture = Picture()

    await read(fleet, gateway, picture)

    everything = {
        "drones": {"drn_1"},
        "missions": {"msn_1"},
        "deliveries": {fleet.delivery_id},
    }
    assert shown(picture, "operator", "op") == everything
    assert shown(picture, "customer", "alice") == everything
    assert shown(picture, "customer", "bob") == {}
    assert shown(picture, "provider", "prv_1") == {"drones": {"drn_1"}, "missions": {"msn_1"}}
    assert shown(picture, "provider", "prv_2") == {}


async def test_a_customer_sees_neither_the_way_home_nor_the_charge(
    gateway: Gateway, fleet: Fleet
) -> None:
    picture = Picture()

    await read(fleet, gateway, picture)

    mission = picture.of_kind("missions")[Key("missions", "msn_1", "alice")].document
    drone = picture.of_kind("drones")[Key("drones", "drn_1", "alice")].document
    assert list(mission["steps"]) == ["1", "2", "3"]
    assert drone.keys() == {"position", "at", "activity", "mission_id"}
    whole = picture.of_kind("missions")[Key("missions", "msn_1")].document
    assert list(whole["steps"]) == ["1", "2", "3", "4"]


async def test_a_provider_sees_the_promise_of_its_own_packages_also_on_the_way_home(
    gateway: Gateway,
) -> None:
    fleet = Fleet(await gateway.planned(packages=2))
    p1, p2 = (await gateway.get(fleet.delivery_id))["packages"]
    assert p1["promised_at"]
    assert p2["promised_at"]
    picture, key = Picture(), Key("missions", "msn_1")
    async with fleet.client("composition") as composition:
        world = World(lambda: {"composition": composition}, gateway.parts.db)
        await Deliveries(gateway.parts.db).read(picture)
        await world.read(picture)

        assert picture.of_kind("missions")[key].document["promises"] == {"p1": p1["promised_at"]}

        picture.remove([*picture.of_kind("deliveries")])
        fleet.missions = [{"mission_id": "msn_1", "version": "2"}]
        await world.read(picture)

    assert picture.of_kind("missions")[key].document["promises"] == {"p1": p1["promised_at"]}
    assert "promises" not in picture.of_kind("missions")[key._replace(audience="alice")].document


@pytest.mark.parametrize(
    "change", [{"mission": {"is_carrying": False}}, {"drone": {"mission_id": "msn_2"}}]
)
async def test_a_customer_sees_no_drone_that_carries_nothing_of_it(
    gateway: Gateway, fleet: Fleet, change: dict[str, dict[str, Any]]
) -> None:
    picture = Picture()
    await read(fleet, gateway, picture)

    fleet.mission |= change.get("mission", {})
    fleet.drone |= change.get("drone", {})
    await read(fleet, gateway, picture)

    assert "drones" not in shown(picture, "customer", "alice")
    assert shown(picture, "operator", "op")["drones"] == {"drn_1"}


async def test_a_customer_sees_the_drone_that_carries_its_packages_with_another_mission(
    gateway: Gateway, fleet: Fleet
) -> None:
    picture = Picture()
    fleet.mission["flown_as"] = fleet.drone["mission_id"] = "msn_of_another"

    await read(fleet, gateway, picture)

    drone = picture.of_kind("drones")[Key("drones", "drn_1", "alice")].document
    assert drone["mission_id"] == "msn_1"


async def test_a_drone_shows_its_heading_and_its_next_landing(
    gateway: Gateway, fleet: Fleet
) -> None:
    picture = Picture()
    await read(fleet, gateway, picture)
    fleet.drone["position"] = [-97.94139, 29.89]

    await read(fleet, gateway, picture)

    drone = picture.of_kind("drones")[Key("drones", "drn_1")].document
    assert drone["heading_deg"] == 0
    assert drone["next_landing"] == {"station_id": "kyle", "at": AT}


async def test_only_missions_with_a_new_version_are_read_again(
    gateway: Gateway, fleet: Fleet
) -> None:
    picture = Picture()
    async with fleet.client("composition") as composition:
        world = World(lambda: {"composition": composition}, gateway.parts.db)
        for version in ("1", "1", "2"):
            fleet.missions = [{"mission_id": "msn_1", "version": version}]
            await world.read(picture)
        assert fleet.calls.count(f"POST {LIVE_MISSIONS}") == 2

        fleet.missions = []
        await world.read(picture)
    assert not picture.of_kind("missions")


async def test_drones_are_asked_for_since_the_last_mark(gateway: Gateway, fleet: Fleet) -> None:
    picture = Picture()
    async with fleet.client("registry") as registry:
        drones = Drones(registry)
        await drones.read(picture)
        fleet.is_whole, fleet.drone["drone_id"] = False, "drn_2"
        await drones.read(picture)
        assert ids(picture.of_kind("drones")) == {"drn_1", "drn_2"}

        fleet.is_whole = True
        await drones.read(picture)

    assert ids(picture.of_kind("drones")) == {"drn_2"}
    assert fleet.calls == [
        "GET /internal/live/drones",
        "GET /internal/live/drones?since=4.0.9",
        "GET /internal/live/drones?since=4.0.9",
    ]


async def test_a_delivery_leaves_the_picture_when_it_ends(gateway: Gateway) -> None:
    picture, deliveries = Picture(), Deliveries(gateway.parts.db)
    delivery_id = await gateway.accepted(reference="order 7")
    await deliveries.read(picture)
    document = picture.of_kind("deliveries")[Key("deliveries", delivery_id)].document
    assert (document["state"], document["reference"]) == ("REQUESTED", "order 7")

    await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer, json={}
    )
    while await gateway.book_next():
        pass
    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"
    await deliveries.read(picture)

    assert not picture.of_kind("deliveries")


def ids(keys: Iterable[Key]) -> set[str]:
    return {key.item_id for key in keys}


async def test_the_last_data_of_a_silent_cell_stays_in_the_picture(
    gateway: Gateway,
) -> None:
    north, south = Fleet(await gateway.planned()), Fleet()
    for name, fleet in (("north", north), ("south", south)):
        fleet.mission["mission_id"] = f"msn_{name}"
        fleet.missions = [{"mission_id": f"msn_{name}", "version": "1"}]
    picture = Picture()
    async with north.client("composition") as first, south.client("composition") as second:
        world = World(lambda: {"composition": first, "the cell south": second}, gateway.parts.db)
        await world.read(picture)
        south.is_away, north.missions = True, []
        await world.read(picture)

        assert ids(picture.of_kind("missions")) == {"msn_south"}
        answering = {
            key.item_id: item.document["is_answering"]
            for key, item in picture.of_kind("services").items()
        }
        assert answering == {"composition of other networks": True, "the cell south": False}
        north.is_away = True
        with pytest.raises(ServiceUnavailable):
            await world.read(picture)
