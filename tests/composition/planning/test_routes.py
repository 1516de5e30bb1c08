"""POST /v1/compositions: every problem gets a plan, a proof, or the name of the wrong field."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.network.geojson import write_network
from skyway.network.synthetic import synthetic_city

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")].model_dump(mode="json")


def problem(network: Any, **members: Any) -> dict[str, Any]:
    return {
        "network": network,
        "drone": {"model": MODEL, "soc": 1.0},
        "source": "a",
        "packages": [{"package_id": "p1", "mass_kg": 0.4, "destination": "c"}],
        **members,
    }


async def compose(composition: Any, body: Any) -> Any:
    return await composition("operator:op", "POST", "/v1/compositions", body)


async def test_a_problem_with_an_inline_network_gets_a_plan(composition: Any, make: Any) -> None:
    answer = await compose(composition, problem(make.network()))

    assert answer.status_code == 200
    assert answer.json()["status"] == "optimal"
    assert [step["kind"] for step in answer.json()["steps"]].count("RECHARGE") == 1


async def test_a_plan_shows_its_proof_and_how_it_was_found(composition: Any, make: Any) -> None:
    plan = (await compose(composition, problem(make.network()))).json()

    assert plan["lower_bound_s"] == pytest.approx(plan["delivery_time_s"], abs=1e-6)
    assert plan["stats"]["strategy"] == "exact"
    assert plan["stats"]["labels"] > 0
    assert plan["stats"]["stations_searched"] > 0


async def test_a_plan_of_a_limited_search_shows_its_lower_bound(
    composition: Any, make: Any
) -> None:
    body = problem(make.network(), label_limit=1)

    plan = (await compose(composition, body)).json()

    assert plan["status"] in ("feasible", "unknown")
    assert plan["lower_bound_s"] > 0


async def test_reservations_that_leave_no_pad_in_time_are_named(
    composition: Any, make: Any
) -> None:
    held = {"station_id": "b", "pad": 0, "start_s": 0, "end_s": None}
    network = make.network(pads={"b": 1})

    plan = (await compose(composition, problem(network, pad_reservations=[held]))).json()

    assert plan["infeasibility"]["code"] == "NO_PAD_IN_TIME"


async def test_a_published_network_includes_its_stored_reservations(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    free = await compose(composition, problem({"network_id": "row"}))
    await composition.book()
    composition.clock.advance(timedelta(minutes=5))

    taken = await compose(composition, problem({"network_id": "row"}))

    assert free.json()["delivery_time_s"] < taken.json()["delivery_time_s"]


async def test_given_reservations_are_added_to_stored_ones(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    held = {"station_id": "b", "pad": 0, "start_s": 0, "end_s": 9000}

    answer = await compose(
        composition, problem({"network_id": "row", "version": 2}, pad_reservations=[held])
    )

    assert answer.json()["waiting_s"] > 0


async def test_an_infeasible_problem_is_answered_with_the_reason(
    composition: Any, make: Any
) -> None:
    heavy = [{"package_id": "p1", "mass_kg": 99, "destination": "c"}]

    answer = await compose(composition, problem(make.network(), packages=heavy))

    assert (answer.status_code, answer.json()["status"]) == (200, "infeasible")
    assert answer.json()["infeasibility"]["code"] == "OVERWEIGHT"


WRONG_MEMBERS: list[tuple[dict[str, Any], str]] = [
    ({"source": "nowhere"}, "source"),
    ({"packages": []}, "packages"),
    (
        {"packages": [{"package_id": "p", "mass_kg": -1, "destination": "c"}]},
        "packages.0.mass_kg",
    ),
    ({"surprise": 1}, "surprise"),
    ({"strategy": "magic"}, "strategy"),
    ({"network": {"network_id": "none"}}, "network"),
    ({"network": {"network_id": "row", "version": 9}}, "network"),
    ({"network": {"network_id": "row", "versions": 1}}, "network.versions"),
    ({"network": {"network_id": "row"}, "start_at": "soon"}, "start_at"),
    ({"network": {"network_id": "row"}, "pad_reservations": 7}, "pad_reservations"),
    ({"network": {"type": "FeatureCollection", "features": 3}}, "network.features"),
    ({"network": None}, "network"),
]


async def test_the_wrong_field_is_named(
    composition: Any, make: Any, subtests: pytest.Subtests
) -> None:
    for members, field in WRONG_MEMBERS:
        with subtests.test(str(members)):
            answer = await compose(composition, problem(make.network()) | members)

            assert answer.status_code == 422, answer.text
            assert answer.json()["errors"][0]["field"].startswith(field)


async def test_an_empty_system_says_how_to_publish_a_network(unpublished: Any) -> None:
    answer = await compose(unpublished, problem({"network_id": "row"}))

    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "network")
    detail = answer.json()["errors"][0]["detail"]
    assert detail == "no network is published: skyway network import bundled"


@pytest.mark.parametrize("body", [[], 7, None, "x"])
async def test_a_body_that_is_not_a_problem_is_refused(composition: Any, body: Any) -> None:
    answer = await compose(composition, body)

    assert answer.status_code in (400, 422)


async def test_broken_json_is_refused(composition: Any) -> None:
    answer = await composition.client.post(
        "/v1/compositions",
        content=b"{",
        headers={"Skyway-Caller": "customer:c", "Content-Type": "application/json"},
    )

    assert answer.status_code == 400


async def test_planning_changes_nothing(composition: Any, make: Any) -> None:
    await compose(composition, problem({"network_id": "row"}))

    assert await composition.reservations() == []
    assert await composition.rows("SELECT * FROM missions") == []


async def test_no_booking_waits_behind_pure_compositions(composition: Any) -> None:
    city = synthetic_city(stations=60, seed=1)
    source, *others = list(city.stations)[:9]
    packages = [{"package_id": place, "mass_kg": 0.01, "destination": place} for place in others]
    slow = problem(write_network(city), source=source, packages=packages, strategy="exhaustive")
    asked = [asyncio.create_task(compose(composition, slow)) for _ in range(4)]
    await asyncio.sleep(0)

    booking = await composition.book()

    assert booking.missions
    assert not any(each.done() for each in asked)
    for each in asked:
        each.cancel()
    await asyncio.gather(*asked, return_exceptions=True)


@pytest.mark.parametrize(
    ("caller", "strategy", "status"),
    [
        ("customer:c", "exhaustive", 403),
        ("provider:p", "exhaustive_with_walks", 403),
        ("operator:op", "exhaustive", 200),
        ("customer:c", "heuristic", 200),
        ("customer:c", "magic", 422),
    ],
)
async def test_strategies_that_try_everything_are_for_operators(
    composition: Any, caller: str, strategy: str, status: int
) -> None:
    body = problem({"network_id": "row"}, strategy=strategy)

    answer = await composition(caller, "POST", "/v1/compositions", body)

    assert answer.status_code == status, answer.text
