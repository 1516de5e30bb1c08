"""Drone models: the library's own are always there; operators and providers add others."""

from typing import Any

import pytest
from skyway_provider_registry.fleets.store import MOST_MODELS

from skyway.drone.models import DRONE_MODELS

MODEL = {
    "model_id": "pelican",
    "empty_mass_kg": 5.0,
    "max_payload_kg": 3.0,
    "battery_j": 1e6,
    "speed_empty_mps": 20.0,
    "speed_full_mps": 15.0,
    "power_empty_w": 500.0,
    "charge_curve": [[0, 0], [3600, 1]],
}


async def test_the_named_models_are_always_there(api: Any) -> None:
    for model in DRONE_MODELS.values():
        assert model.charge_columns, "what a process has computed of a model is no member of it"

    listed = await api("customer:c", "GET", "/v1/drone-models")

    assert {item["model_id"] for item in listed.json()["items"]} == set(DRONE_MODELS)


async def test_a_new_model_can_be_flown(api: Any) -> None:
    provider_id = await api.provider()

    made = await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)

    drone = await api.drone(provider_id, model_id="pelican")
    read = await api(f"provider:{provider_id}", "GET", "/v1/drone-models/pelican")
    assert made.status_code == 201
    assert read.json() == made.json() == {**drone["model"], "provider_id": None}


async def test_the_same_model_again_is_not_new(api: Any) -> None:
    await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)

    again = await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)

    assert again.status_code == 200


async def test_a_model_may_change_until_its_first_drone(api: Any) -> None:
    provider_id = await api.provider()
    heavier = {**MODEL, "max_payload_kg": 4.0}
    await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)

    early = await api("operator:op", "PUT", "/v1/drone-models/pelican", heavier)
    await api.drone(provider_id, model_id="pelican")
    late = await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)

    assert early.json()["max_payload_kg"] == 4.0
    assert (late.status_code, late.json()["code"]) == (409, "MODEL_IN_USE")


async def test_a_named_model_cannot_be_replaced(api: Any) -> None:
    body = {**MODEL, "model_id": "paper-scenario"}

    answer = await api("operator:op", "PUT", "/v1/drone-models/paper-scenario", body)

    assert (answer.status_code, answer.json()["code"]) == (409, "NAMED_MODEL")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"model_id": "other"}, "model_id"),
        ({"battery_j": -1}, "battery_j"),
        ({"colour": "red"}, "colour"),
    ],
)
async def test_a_bad_model_is_refused_with_its_field(
    api: Any, change: dict[str, object], field: str
) -> None:
    answer = await api("operator:op", "PUT", "/v1/drone-models/pelican", {**MODEL, **change})

    assert answer.status_code == 422
    assert [problem["field"] for problem in answer.json()["errors"]] == [field]


async def test_a_model_needs_its_id_only_in_the_path(api: Any) -> None:
    body = {name: value for name, value in MODEL.items() if name != "model_id"}

    made = await api("operator:op", "PUT", "/v1/drone-models/pelican", body)

    assert (made.status_code, made.json()["model_id"]) == (201, "pelican")


async def test_customers_add_no_models(api: Any) -> None:
    answer = await api("customer:c", "PUT", "/v1/drone-models/pelican", MODEL)

    assert answer.status_code == 403


async def test_a_provider_replaces_only_models_that_it_added(api: Any) -> None:
    first, second = await api.provider(), await api.provider()
    heavier = {**MODEL, "max_payload_kg": 4.0}
    await api("operator:op", "PUT", "/v1/drone-models/pelican", MODEL)
    added = await api(f"provider:{first}", "PUT", "/v1/drone-models/heron", _named("heron"))

    own = await api(f"provider:{first}", "PUT", "/v1/drone-models/heron", _named("heron", heavier))
    others = [
        await api(f"provider:{first}", "PUT", "/v1/drone-models/pelican", heavier),
        await api(f"provider:{second}", "PUT", "/v1/drone-models/heron", _named("heron")),
    ]
    by_operator = await api("operator:op", "PUT", "/v1/drone-models/heron", _named("heron"))

    assert (added.status_code, own.status_code, by_operator.status_code) == (201, 200, 200)
    for refused in others:
        assert (refused.status_code, refused.json()["code"]) == (409, "OTHERS_MODEL")
    pelican = (await api("customer:c", "GET", "/v1/drone-models/pelican")).json()
    assert pelican["max_payload_kg"] == MODEL["max_payload_kg"]


async def test_a_providers_model_is_its_own_until_an_operator_approves_it(api: Any) -> None:
    first, second = await api.provider(), await api.provider()
    heron = "/v1/drone-models/heron"
    await api(f"provider:{first}", "PUT", heron, _named("heron"))
    await api.drone(first, model_id="heron")
    body = {"model_id": "heron", "home_station_id": "s1"}
    battery = {"model_id": "heron", "serial": "TB60"}
    fleet = f"/v1/providers/{second}"

    refused = [
        await api(f"provider:{second}", "POST", f"{fleet}/drones", body),
        await api("operator:op", "POST", f"{fleet}/batteries", battery),
        await api("operator:op", "PUT", f"{fleet}/maintenance-rules/heron", {"every_cycles": 5}),
    ]
    listed = (await api(f"provider:{second}", "GET", heron)).json()
    approved = await api("operator:op", "PUT", heron, listed)

    assert [answer.status_code for answer in refused] == [422] * 3
    assert refused[0].json()["errors"][0]["field"] == "model_id"
    assert listed["provider_id"] == first
    assert (approved.status_code, approved.json()["provider_id"]) == (200, None)
    assert (await api.drone(second, model_id="heron"))["model"]["model_id"] == "heron"


async def test_an_approved_model_is_not_its_providers_any_more(api: Any) -> None:
    provider = f"provider:{await api.provider()}"
    await api(provider, "PUT", "/v1/drone-models/heron", _named("heron"))
    await api("operator:op", "PUT", "/v1/drone-models/heron", _named("heron"))

    changed = {**_named("heron"), "max_payload_kg": 4.0}
    answer = await api(provider, "PUT", "/v1/drone-models/heron", changed)

    assert (answer.status_code, answer.json()["code"]) == (409, "OTHERS_MODEL")


async def test_a_model_is_not_sent_with_another_owner(api: Any) -> None:
    first, second = await api.provider(), await api.provider()
    body = {**_named("heron"), "provider_id": first}
    own = await api(f"provider:{first}", "PUT", "/v1/drone-models/heron", body)

    others = {**body, "provider_id": second, "max_payload_kg": 4.0}
    wrong = await api("operator:op", "PUT", "/v1/drone-models/heron", others)

    kept = (await api("operator:op", "GET", "/v1/drone-models/heron")).json()
    assert (own.status_code, own.json()["provider_id"]) == (201, first)
    assert (wrong.status_code, wrong.json()["errors"][0]["field"]) == (422, "provider_id")
    assert (kept["provider_id"], kept["max_payload_kg"]) == (first, 3.0)


async def test_a_provider_adds_a_limited_number_of_models(api: Any) -> None:
    provider_id = await api.provider()
    for number in range(MOST_MODELS):
        name = f"heron-{number}"
        made = await api(f"provider:{provider_id}", "PUT", f"/v1/drone-models/{name}", _named(name))
        assert made.status_code == 201

    beyond = await api(f"provider:{provider_id}", "PUT", "/v1/drone-models/swan", _named("swan"))
    again = await api(
        f"provider:{provider_id}", "PUT", "/v1/drone-models/heron-0", _named("heron-0")
    )

    assert (beyond.status_code, beyond.json()["code"]) == (409, "TOO_MANY_MODELS")
    assert again.status_code == 200


def _named(model_id: str, model: dict[str, Any] = MODEL) -> dict[str, Any]:
    return {**model, "model_id": model_id}


async def test_an_unknown_model_is_not_found(api: Any) -> None:
    answer = await api("customer:c", "GET", "/v1/drone-models/paper-plane")

    assert answer.status_code == 404
