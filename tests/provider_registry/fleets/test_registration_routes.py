"""Registration of one drone or a whole fleet: all or none."""

import json
from pathlib import Path
from typing import Any

import pytest
from skyway_verifier.registry.rules import RULES

from skyway.broker_setup.passwords import matches, read_password_file
from tests.broken_rules import broken_rules

pytestmark = pytest.mark.databases("sqlite")

DRONE = {"model_id": "paper-scenario", "home_station_id": "san-marcos"}

BAD_DRONES: list[tuple[Any, list[str]]] = [
    ({**DRONE, "model_id": "paper-plane"}, ["model_id"]),
    ({**DRONE, "home_station_id": "atlantis"}, ["home_station_id"]),
    ({**DRONE, "soc": 1.01}, ["soc"]),
    ({**DRONE, "soc": -0.01}, ["soc"]),
    ({**DRONE, "soc": "full"}, ["soc"]),
    ({**DRONE, "colour": "red"}, ["colour"]),
    ({**DRONE, "name": ""}, ["name"]),
    ({"model_id": "paper-scenario"}, ["home_station_id"]),
    ([DRONE, {**DRONE, "model_id": "paper-plane"}], ["1.model_id"]),
    ([{**DRONE, "home_station_id": "atlantis"}, DRONE], ["0.home_station_id"]),
    ([DRONE, {**DRONE, "soc": 2}], ["1.soc"]),
    ([DRONE, {**DRONE, "colour": "red"}], ["1.colour"]),
    ([DRONE, {}], ["1.model_id", "1.home_station_id"]),
    (
        [{"model_id": "paper-plane", "home_station_id": "atlantis"}],
        ["0.model_id", "0.home_station_id"],
    ),
    (
        [{**DRONE, "registration": "N1"}, DRONE, {**DRONE, "registration": "N1"}],
        ["2.registration"],
    ),
    ([], ["body"]),
    ("drone", ["body"]),
    (None, ["body"]),
]


@pytest.fixture
async def provider_id(api: Any) -> str:
    made: str = await api.provider()
    return made


async def test_one_new_drone_is_answered_with_one_drone(api: Any, provider_id: str) -> None:
    body = {**DRONE, "name": "Heron", "registration": "N123", "soc": 0.5}
    path = f"/v1/providers/{provider_id}/drones"

    answer = await api(f"provider:{provider_id}", "POST", path, body)

    drone = answer.json()
    assert answer.status_code == 201
    assert answer.headers["location"] == f"{path}/{drone['drone_id']}"
    assert drone["home_position"] == [-97.94139, 29.88327]
    assert drone["model"]["model_id"] == drone["model_id"] == "paper-scenario"
    assert (drone["state"], drone["soc"], drone["position"]) == ("REGISTERED", 0.5, None)
    assert drone["mqtt"]["user_name"] == f"{drone['provider_id']}/{drone['drone_id']}"
    assert drone["drone_id"].startswith("drn_")


async def test_the_secrets_are_shown_only_once(api: Any, provider_id: str) -> None:
    made = await api.drone(provider_id)

    path = f"/v1/providers/{provider_id}/drones"
    one = await api("operator:op", "GET", f"{path}/{made['drone_id']}")
    listed = await api("operator:op", "GET", path)

    del made["mqtt"], made["enrolment_token"], made["cloud_keys"]
    assert one.json() == made
    assert listed.json()["items"] == [made]


async def test_a_list_is_answered_with_items_in_its_order(api: Any, provider_id: str) -> None:
    bodies = [{**DRONE, "name": name} for name in ("c", "a", "b")]

    answer = await api("operator:op", "POST", f"/v1/providers/{provider_id}/drones", bodies)

    assert [drone["name"] for drone in answer.json()["items"]] == ["c", "a", "b"]


async def test_drones_log_in_with_the_shown_accounts(
    api: Any, provider_id: str, tmp_path: Path
) -> None:
    bodies = [DRONE, DRONE]

    answer = await api("operator:op", "POST", f"/v1/providers/{provider_id}/drones", bodies)

    accounts = read_password_file(tmp_path / "passwords")
    for drone in answer.json()["items"]:
        mqtt = drone["mqtt"]
        assert matches(mqtt["password"], accounts[mqtt["user_name"]])


async def test_a_bad_drone_is_refused_with_its_field_and_place(
    api: Any, provider_id: str, subtests: pytest.Subtests
) -> None:
    path = f"/v1/providers/{provider_id}/drones"
    for body, fields in BAD_DRONES:
        with subtests.test(json.dumps(body)):
            answer = await api("operator:op", "POST", path, body)

            left = await api("operator:op", "GET", path)
            assert answer.status_code == 422, answer.text
            assert [problem["field"] for problem in answer.json()["errors"]] == fields
            assert left.json()["items"] == []


async def test_more_than_500_drones_are_refused(api: Any, provider_id: str) -> None:
    path = f"/v1/providers/{provider_id}/drones"

    answer = await api("operator:op", "POST", path, [DRONE] * 501)

    assert answer.status_code == 422
    assert "500" in answer.json()["errors"][0]["detail"]


async def test_a_body_above_256_kib_is_refused(api: Any, provider_id: str) -> None:
    path = f"/v1/providers/{provider_id}/drones"

    answer = await api("operator:op", "POST", path, [{**DRONE, "name": "x" * 256 * 1024}])

    assert answer.status_code == 413


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_registration_is_unique_within_a_provider(api: Any, provider_id: str) -> None:
    other = await api.provider()
    await api.drone(provider_id, registration="N1")
    await api.drone(other, registration="N1")

    path = f"/v1/providers/{provider_id}/drones"
    again = await api("operator:op", "POST", path, [DRONE, {**DRONE, "registration": "N1"}])

    left = await api("operator:op", "GET", path)
    assert again.status_code == 409
    assert again.json()["code"] == "REGISTRATION_TAKEN"
    assert "'N1'" in again.json()["detail"]
    assert len(left.json()["items"]) == 1


async def test_no_drone_is_registered_with_another_provider(api: Any, provider_id: str) -> None:
    other = await api.provider()

    foreign = await api(f"provider:{other}", "POST", f"/v1/providers/{provider_id}/drones", DRONE)
    no_provider = await api("operator:op", "POST", "/v1/providers/prv_0/drones", DRONE)
    customer = await api("customer:c", "POST", f"/v1/providers/{provider_id}/drones", DRONE)

    assert (foreign.status_code, no_provider.status_code, customer.status_code) == (404, 404, 403)


async def test_without_composition_the_answer_names_it(
    api: Any, provider_id: str, stations: Any
) -> None:
    stations.is_away = True

    answer = await api("operator:op", "POST", f"/v1/providers/{provider_id}/drones", DRONE)

    assert answer.status_code == 503
    assert "composition" in answer.json()["detail"]


async def test_the_same_key_registers_one_fleet_with_the_same_passwords(
    api: Any, provider_id: str, tmp_path: Path
) -> None:
    path = f"/v1/providers/{provider_id}/drones"

    first = await api("operator:op", "POST", path, [DRONE], key="k")
    again = await api("operator:op", "POST", path, [DRONE], key="k")
    other = await api("operator:op", "POST", path, [DRONE, DRONE], key="k")

    mqtt = again.json()["items"][0]["mqtt"]
    accounts = read_password_file(tmp_path / "passwords")
    assert again.json() == first.json()
    assert matches(mqtt["password"], accounts[mqtt["user_name"]])
    assert other.status_code == 422
    assert len((await api("operator:op", "GET", path)).json()["items"]) == 1


async def test_two_providers_may_use_the_same_key(api: Any, provider_id: str) -> None:
    other = await api.provider()
    await api("operator:op", "POST", f"/v1/providers/{provider_id}/drones", DRONE, key="k")

    answer = await api("operator:op", "POST", f"/v1/providers/{other}/drones", DRONE, key="k")

    assert answer.json()["provider_id"] == other


async def test_500_drones_are_registered_in_one_call(
    api: Any, provider_id: str, db: Any, statements: Any
) -> None:
    with statements() as executed:
        answer = await api(
            "operator:op", "POST", f"/v1/providers/{provider_id}/drones", [DRONE] * 500
        )

    ids = {drone["drone_id"] for drone in json.loads(answer.content)["items"]}
    assert len(ids) == 500
    assert await broken_rules(db, RULES) == []
    assert len(executed) < 20


async def test_a_provider_has_at_most_so_many_drones(api: Any) -> None:
    provider_id = await api.provider()
    path = f"/v1/providers/{provider_id}/drones"
    for _ in range(3):
        answer = await api("operator:op", "POST", path, [DRONE] * 500)
        assert answer.status_code == 201, answer.text

    refused = await api("operator:op", "POST", path, [DRONE] * 301)

    assert refused.status_code == 409
    assert refused.json()["code"] == "TOO_MANY_DRONES"
    quota = await api(None, "GET", f"/internal/providers/{provider_id}/drone-quota")
    assert quota.json() == {"most": 1_800, "used": 1_500}


async def test_a_suspended_provider_registers_no_drones(api: Any) -> None:
    provider_id = await api.provider()
    path = f"/v1/providers/{provider_id}"
    await api("operator:op", "PATCH", path, {"state": "SUSPENDED"})

    refused = await api(f"provider:{provider_id}", "POST", f"{path}/drones", DRONE)
    by_operator = await api("operator:op", "POST", f"{path}/drones", DRONE)

    assert (refused.status_code, refused.json()["code"]) == (409, "PROVIDER_SUSPENDED")
    assert by_operator.status_code == 201
    await api("operator:op", "PATCH", path, {"state": "ACTIVE"})
    again = await api(f"provider:{provider_id}", "POST", f"{path}/drones", DRONE)
    assert again.status_code == 201
