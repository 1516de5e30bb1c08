"""Loaders confirm measured masses; a drone with another load than agreed does not take off."""

from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

LOADER = "provider:prv_1"


async def confirm(
    composition: Any, mission_id: str, masses_kg: dict[str, float], caller: str = LOADER
) -> Any:
    packages = [{"package_id": name, "mass_kg": mass_kg} for name, mass_kg in masses_kg.items()]
    return await composition(
        caller, "POST", f"/v1/missions/{mission_id}/loading", {"packages": packages}
    )


async def shown(composition: Any, mission_id: str) -> Any:
    return (await composition("operator:op", "GET", f"/v1/missions/{mission_id}")).json()


@pytest.mark.databases("sqlite", "postgresql")
async def test_missions_that_wait_for_a_loader_can_be_listed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await composition.book(make.candidate(2), delivery_id="dlv_2")

    listed = await composition(LOADER, "GET", "/v1/missions?loading=AWAITED")

    assert [item["mission_id"] for item in listed.json()["items"]] == [instruction.mission_id]


@pytest.mark.databases("sqlite", "postgresql")
async def test_measured_masses_replace_the_agreed_ones(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    answer = await confirm(composition, instruction.mission_id, {"p1": 0.42})

    assert (answer.status_code, answer.json()["outcome"]) == (200, "CONFIRMED")
    trouble = (await shown(composition, instruction.mission_id))["trouble"]
    assert (trouble["code"], trouble["loaded"]) == (
        "LOADED",
        [{"package_id": "p1", "mass_kg": 0.42}],
    )
    ((request,),) = await composition.rows("SELECT request FROM missions")
    assert '"mass_kg":0.42' in request


@pytest.mark.parametrize(
    ("masses_kg", "code"),
    [
        ({"p1": 0.4}, "PACKAGE_MISSING"),
        ({}, "PACKAGE_MISSING"),
        ({"p1": 0.4, "p2": 0.46}, "MASS_MISMATCH"),
        ({"p1": 0.34, "p2": 0.4}, "MASS_MISMATCH"),
    ],
)
async def test_a_loading_that_differs_from_the_request_ends_the_mission(
    composition: Any,
    drone: Any,
    make: Any,
    begin: Any,
    masses_kg: dict[str, float],
    code: str,
) -> None:
    instruction = await begin.at_pickup(composition, drone, make, "b", "c")

    answer = await confirm(composition, instruction.mission_id, masses_kg)

    assert (answer.status_code, answer.json()["outcome"]) == (200, "REFUSED")
    assert answer.json()["code"] == code
    report = (await composition.reports())[-1]
    assert (report.kind, report.code, report.mission_state) == ("ENDED", code, "CANCELLED")
    assert (await composition.sent())[-1].kind == "CANCEL"
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_failed_loading_raises_an_alarm_for_the_provider(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    await confirm(composition, instruction.mission_id, {"p1": 0.8})

    (alarm,) = (await composition(LOADER, "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["mission_id"]) == ("MASS_MISMATCH", instruction.mission_id)
    assert alarm["data"] == {"package_id": "p1", "mass_kg": 0.8, "agreed_kg": 0.4}


async def test_small_differences_may_not_add_up_above_the_payload_limit(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    limit_kg = 0.4
    model = make.candidate().model.model_copy(update={"max_payload_kg": limit_kg})
    await composition.book(make.candidate(loading="CONFIRMED", model=model))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction), begin.standing(drone, instruction))

    answer = await confirm(composition, instruction.mission_id, {"p1": limit_kg + 0.04})

    assert answer.json()["code"] == "MASS_MISMATCH"
    assert "limit" in answer.json()["detail"]


async def test_a_loading_is_confirmed_once(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await confirm(composition, instruction.mission_id, {"p1": 0.4})

    again = await confirm(composition, instruction.mission_id, {"p1": 0.4})

    assert (again.status_code, again.json()["code"]) == (409, "ALREADY_CONFIRMED")


async def test_only_a_drone_at_the_pickup_is_loaded(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, loading="CONFIRMED")
    before = await confirm(composition, instruction.mission_id, {"p1": 0.4})
    await composition.receive(begin.standing(drone, instruction, station_id="b"))
    elsewhere = await confirm(composition, instruction.mission_id, {"p1": 0.4})
    await composition.receive(begin.standing(drone, instruction, activity="WAITING"))
    idle = await confirm(composition, instruction.mission_id, {"p1": 0.4})

    assert [each.json()["code"] for each in (before, elsewhere, idle)] == ["NOT_LOADING"] * 3


async def test_an_automatic_loading_cannot_be_confirmed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(begin.standing(drone, instruction))

    answer = await confirm(composition, instruction.mission_id, {"p1": 0.4})

    assert (answer.status_code, answer.json()["code"]) == (409, "NOT_LOADING")


async def test_an_ended_mission_cannot_be_loaded(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await confirm(composition, instruction.mission_id, {"p1": 4.0})

    answer = await confirm(composition, instruction.mission_id, {"p1": 0.4})

    assert (answer.status_code, answer.json()["code"]) == (409, "MISSION_OVER")


async def test_a_provider_cannot_load_missions_of_others(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    foreign = await confirm(composition, instruction.mission_id, {"p1": 0.4}, "provider:prv_2")
    customer = await confirm(composition, instruction.mission_id, {"p1": 0.4}, "customer:c")
    operator = await confirm(composition, instruction.mission_id, {"p1": 0.4}, "operator:op")

    assert [each.status_code for each in (foreign, customer, operator)] == [404, 403, 200]


@pytest.mark.parametrize("names", [("p1", "p9"), ("p1", "p1")])
async def test_each_listed_package_belongs_to_the_mission_and_occurs_once(
    composition: Any, drone: Any, make: Any, begin: Any, names: tuple[str, ...]
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    answer = await composition(
        LOADER,
        "POST",
        f"/v1/missions/{instruction.mission_id}/loading",
        {"packages": [{"package_id": name, "mass_kg": 0.4} for name in names]},
    )

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "packages.1.package_id"
    assert (await shown(composition, instruction.mission_id))["trouble"] is None
