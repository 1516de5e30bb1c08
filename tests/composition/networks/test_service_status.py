"""GET /v1/networks/{network_id}/status: is the service open, and what restricts it?"""

import dataclasses
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest
from skyway_composition.app import composition_app
from skyway_composition.closures.closure import Closure, ClosureKind
from skyway_composition.closures.network_weather import ClosedNow
from skyway_composition.networks.service_status import (
    NetworkStatus,
    closed_to_models,
    status_of,
)

from skyway.contracts.drones import DronesOfModel, NetworkDrones
from skyway.drone.models import DRONE_MODELS
from skyway.ids import ClosureId, DroneModelId, NetworkId
from skyway.units import moment_to_ms
from tests.shared_app import shared_app

NOW_MS = 1_000_000
ROW = NetworkId("row")


def drones(model: str = "small", *, registered: int = 4, online: int = 3, idle: int = 2) -> Any:
    return DronesOfModel(
        model_id=DroneModelId(model),
        max_payload_kg=2.7,
        model=DRONE_MODELS[DroneModelId("paper-scenario")],
        registered=registered,
        online=online,
        idle=idle,
    )


def closure(kind: ClosureKind, **members: Any) -> Closure:
    return Closure(
        closure_id=ClosureId("cls_1"), kind=kind, network_id=ROW, from_ms=0, made_ms=0, **members
    )


def status(*models: DronesOfModel, closures: Any = (), unplaced: int = 0) -> NetworkStatus:
    counted = NetworkDrones(models=models, unplaced=unplaced)
    return status_of(ROW, closures, counted, now_ms=NOW_MS)


def test_a_network_with_idle_drones_and_no_closures_is_open() -> None:
    found = status(drones())

    assert (found.status, found.restrictions, found.more_restrictions) == ("OPEN", (), 0)
    assert [(each.model_id, each.status) for each in found.models] == [("small", "OPEN")]


def test_a_network_without_drones_is_paused_and_says_so() -> None:
    for models in ((), (drones(online=0, idle=0),)):
        found = status(*models)

        assert found.status == "PAUSED"
        assert [each.code for each in found.restrictions] == ["NO_DRONES"]


def test_drones_in_an_unknown_place_are_not_said_to_be_missing() -> None:
    assert status(unplaced=3).status == "OPEN"


def test_busy_drones_degrade_the_service() -> None:
    found = status(drones(idle=0))

    assert (found.status, found.models[0].status) == ("DEGRADED", "DEGRADED")
    assert found.restrictions[0].code == "NO_IDLE_DRONES"


def test_a_model_without_drones_is_named_while_others_fly() -> None:
    found = status(drones("large", online=0, idle=0), drones("small"))

    assert found.status == "DEGRADED"
    assert [(each.code, each.model_id) for each in found.restrictions] == [("NO_DRONES", "large")]
    assert {each.model_id: each.status for each in found.models} == {
        "large": "PAUSED",
        "small": "OPEN",
    }


def test_a_ground_stop_without_limits_pauses_the_network() -> None:
    found = status(drones(), closures=[closure("GROUND_STOP", reason="storm")])

    assert (found.status, found.models[0].status) == ("PAUSED", "PAUSED")
    assert found.restrictions[0].detail == "no drone may take off: storm"


def test_a_ground_stop_of_one_model_pauses_only_that_model() -> None:
    stop = closure("GROUND_STOP", drone_model_id=DroneModelId("large"))
    both = status(drones("large"), drones("small"), closures=[stop])
    alone = status(drones("large"), closures=[stop])

    assert (both.status, [each.status for each in both.models]) == ("DEGRADED", ["PAUSED", "OPEN"])
    assert alone.status == "PAUSED"


@pytest.mark.parametrize(
    ("kind", "members", "detail"),
    [
        ("STATION", {"station_id": "b"}, "station b is closed: fog"),
        ("PAD", {"station_id": "b", "pad": 1}, "pad 1 of station b is out of order: fog"),
        (
            "SEGMENT",
            {"station_id": "b", "to_station_id": "c"},
            "the segment from b to c is closed: fog",
        ),
        ("ZONE", {}, "an area is closed to flights: fog"),
        ("GROUND_STOP", {"provider_id": "p"}, "no drone of provider p may take off: fog"),
    ],
)
def test_a_closed_place_degrades_the_service(
    kind: ClosureKind, members: dict[str, Any], detail: str
) -> None:
    found = status(drones(), closures=[closure(kind, reason="fog", **members)])

    assert (found.status, found.restrictions[0].detail) == ("DEGRADED", detail)


def test_too_much_wind_makes_a_network_degraded_or_paused() -> None:
    some, every = (ClosedNow(closed, segments=8, until_ms=2_000_000) for closed in (3, 8))
    counted = NetworkDrones(models=(drones("large"), drones("small")), unplaced=0)
    found = {
        name: status_of(ROW, (), counted, now_ms=NOW_MS, windy=windy)
        for name, windy in (
            ("some", {DroneModelId("small"): some}),
            ("one model", {DroneModelId("small"): every}),
            ("all", {DroneModelId("small"): every, DroneModelId("large"): every}),
        )
    }

    assert {name: each.status for name, each in found.items()} == {
        "some": "DEGRADED",
        "one model": "DEGRADED",
        "all": "PAUSED",
    }
    assert [each.status for each in found["one model"].models] == ["OPEN", "PAUSED"]
    (restriction,) = found["some"].restrictions
    assert restriction.code == "TOO_MUCH_WIND"
    assert restriction.detail == (
        "3 of 8 segments are closed to drones of model small: the wind is too strong"
    )
    assert restriction.until == datetime(1970, 1, 1, 0, 33, 20, tzinfo=UTC)


def test_at_most_100_restrictions_are_listed_and_the_others_counted() -> None:
    found = status(drones(), closures=[closure("STATION", station_id="b")] * 130)

    assert (len(found.restrictions), found.more_restrictions) == (100, 30)


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_the_status_shows_closures_that_are_in_force_now(composition: Any) -> None:
    operator = "operator:op"
    later = composition.clock.now().replace(year=2030).isoformat()
    await composition(operator, "POST", "/v1/stations/b/closures", {"reason": "roof"})
    await composition(operator, "POST", "/v1/stations/c/closures", {"from_at": later})

    answer = await composition("customer:c", "GET", "/v1/networks/row/status")
    missing = await composition("customer:c", "GET", "/v1/networks/nowhere/status")

    found = NetworkStatus.model_validate_json(answer.content)
    assert [(each.code, each.station_id) for each in found.restrictions] == [
        ("NO_DRONES", None),
        ("STATION_CLOSED", "b"),
    ]
    assert missing.status_code == 404


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_the_status_names_the_models_for_which_there_is_too_much_wind(
    composition: Any, make: Any
) -> None:
    now = composition.clock.now().isoformat()
    wind = {"valid_at": now, "wind_speed_mps": 7.0, "wind_from_deg": 0.0}
    forecast = {
        "source": "test",
        "issued_at": now,
        "reports": [{"station_id": each, **wind} for each in "ace"],
    }
    await composition("operator:op", "PUT", "/v1/networks/row/weather", forecast)
    weak = make.candidate().model.model_copy(update={"max_wind_mps": 6.0})
    models = [
        drones(name).model_copy(update={"model": model})
        for name, model in (("weak", weak), ("strong", make.candidate().model))
    ]
    skyway = await composition.parts.networks.current(ROW)
    now_ms = moment_to_ms(composition.clock.now())
    _, conditions = await skyway.conditions.read(composition.db, after_ms=now_ms)

    windy = await closed_to_models(
        conditions.weather, NetworkDrones(models=tuple(models), unplaced=0), now_ms=now_ms
    )

    assert {name: each.is_all for name, each in windy.items()} == {"weak": True}


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_only_operators_see_how_many_drones_there_are(composition: Any) -> None:
    async def counted(_network_id: NetworkId) -> NetworkDrones:
        return NetworkDrones(models=(drones(),), unplaced=0)

    parts = dataclasses.replace(composition.parts, count_drones=counted)
    seen = {}
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(shared_app(composition_app, parts)),
        base_url="http://composition",
        headers={"Authorization": "Bearer secret of gateway"},
    ) as client:
        for caller in ("operator:op", "customer:c", "provider:p", "service:gateway"):
            answer = await client.get("/v1/networks/row/status", headers={"Skyway-Caller": caller})
            (model,) = NetworkStatus.model_validate_json(answer.content).models
            assert (model.status, model.max_payload_kg) == ("OPEN", 2.7)
            seen[caller.partition(":")[0]] = (model.registered, model.online, model.idle)

    hidden = (None, None, None)
    assert seen == {
        "operator": (4, 3, 2),
        "customer": hidden,
        "provider": hidden,
        "service": hidden,
    }
