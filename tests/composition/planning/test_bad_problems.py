"""POST /v1/compositions: the problem document names every wrong field."""

import copy
import json
from typing import Any

import httpx
import pytest

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")].model_dump(mode="json")
#: A body's whole numbers must have 64 bits; this number is too long for every field.
TOO_LONG = str(10**40)


async def post(composition: Any, document: Any) -> httpx.Response:
    """The answer to a body with JSON that common libraries refuse to write."""
    answer: httpx.Response = await composition.client.post(
        "/v1/compositions",
        content=json.dumps(document).encode(),
        headers={"Skyway-Caller": "customer:c", "Content-Type": "application/json"},
    )
    return answer


async def test_every_fault_names_its_field_and_limit(
    composition: Any, bad_problems: Any, subtests: pytest.Subtests
) -> None:
    for bad in bad_problems:
        with subtests.test(bad.name):
            answer = await post(composition, bad.document)

            problem = answer.json()
            assert answer.status_code == 422
            assert answer.headers["content-type"] == "application/problem+json"
            assert problem["type"] == "urn:skyway:problem:invalid-input"
            assert problem["errors"][0]["field"].startswith(bad.field)
            if TOO_LONG not in json.dumps(bad.document):
                assert bad.message in problem["errors"][0]["detail"]


async def test_one_answer_names_all_faults(composition: Any, good_problem: Any) -> None:
    document = {**good_problem, "source": 7, "finish": "home", "loading_s": -1, "surprise": 1}

    problem = (await post(composition, document)).json()

    fields = [fault["field"] for fault in problem["errors"]]
    assert fields == ["surprise", "source", "finish", "loading_s"]
    assert problem["detail"].endswith("; and 1 more")


@pytest.mark.long
async def test_a_million_packages_get_a_short_answer(composition: Any, good_problem: Any) -> None:
    package = {"mass_kg": -1}

    answer = await post(composition, {**good_problem, "packages": [package] * 10**6})

    assert answer.status_code == 422
    assert answer.json()["errors"] == [
        {"field": "packages", "detail": "1000000 packages exceed the limit of 100"}
    ]


async def test_very_deep_json_is_refused(composition: Any) -> None:
    answer = await composition.client.post(
        "/v1/compositions",
        content=b"[" * 100_000,
        headers={"Skyway-Caller": "customer:c", "Content-Type": "application/json"},
    )

    assert answer.status_code in (400, 422)
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.long
async def test_a_wrong_field_is_named_with_a_published_network_too(
    composition: Any, make: Any, bad_problems: Any, subtests: pytest.Subtests
) -> None:
    for bad in bad_problems:
        # A fault between the problem and its inline network does not exist here.
        if bad.field.startswith(("network", "start_at")) or "station" in bad.message:
            continue
        document = copy.deepcopy(bad.document) | {"network": {"network_id": "row"}}
        with subtests.test(bad.name):
            answer = await post(composition, document)

            assert answer.status_code == 422
            fields = {fault["field"] for fault in answer.json()["errors"]}
            assert any(field.startswith(bad.field) for field in fields)


@pytest.mark.parametrize("version", [0, 2**31, 2**40, 2**53])
async def test_a_version_that_no_column_holds_is_named(
    composition: Any, bad_problems: Any, version: int
) -> None:
    network = {"network_id": "row", "version": version}

    answer = await post(composition, bad_problems[0].document | {"network": network})

    assert answer.status_code == 422
    assert [fault["field"] for fault in answer.json()["errors"]] == ["network.version"]


async def test_given_reservations_may_overlap_stored_ones(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    await composition.book()
    (stored, *_) = await composition.reservations()
    given = {"station_id": "b", "pad": 0, "start_s": 0, "end_s": 9000}
    document = {
        "network": {"network_id": "row"},
        "drone": {"model": MODEL, "soc": 1.0},
        "source": "a",
        "packages": [{"package_id": "p1", "mass_kg": 0.4, "destination": "c"}],
        "pad_reservations": [given],
    }

    answer = await post(composition, document)

    assert stored is not None
    assert answer.status_code == 200, answer.text
    assert answer.json()["waiting_s"] > 0
