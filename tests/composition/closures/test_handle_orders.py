"""Closures over REST: make, preview, list and lift."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
SQUARE = {"type": "Polygon", "coordinates": [[[0.3, -1], [0.4, -1], [0.4, 1], [0.3, 1], [0.3, -1]]]}

#: A call that closes something in the row of stations a to e, and the members that identify it.
CLOSINGS = [
    ("/v1/stations/b/closures", {}, {"kind": "STATION", "station_id": "b"}),
    ("/v1/stations/b/pads/1/outages", {}, {"kind": "PAD", "station_id": "b", "pad": 1}),
    ("/v1/segments/b/c/closures", {}, {"kind": "SEGMENT", "from_id": "b", "to_id": "c"}),
    ("/v1/zones", {"network_id": "row", "area": SQUARE}, {"kind": "ZONE", "network_id": "row"}),
    (
        "/v1/ground-stops",
        {"reason": "storm", "provider_id": "prv_9"},
        {"kind": "GROUND_STOP", "provider_id": "prv_9", "network_id": None},
    ),
]


@pytest.mark.parametrize(("path", "body", "members"), CLOSINGS)
async def test_a_closure_is_listed_until_it_is_lifted(
    composition: Any, path: str, body: Any, members: Any
) -> None:
    made = await composition(OPERATOR, "POST", path, body)
    listed = await composition("customer:c", "GET", path)
    closure_id = made.json()["closure_id"]
    lifted = [await composition(OPERATOR, "DELETE", f"{path}/{closure_id}") for _ in range(2)]
    after = await composition("customer:c", "GET", path)
    ever = await composition("customer:c", "GET", f"{path}?all=true")

    assert made.status_code == 201, made.text
    assert made.json()["affected_missions"] == []
    assert made.json().items() >= members.items()
    assert [each["closure_id"] for each in listed.json()["items"]] == [closure_id]
    assert [each.status_code for each in lifted] == [204, 204]
    assert after.json()["items"] == []
    assert ever.json()["items"][0]["lifted_at"] is not None


@pytest.mark.parametrize(("path", "body", "members"), CLOSINGS)
async def test_only_operators_make_closures(
    composition: Any, path: str, body: Any, members: Any
) -> None:
    for caller in ("customer:c", "provider:prv_1"):
        for method, below in (("POST", path), ("DELETE", f"{path}/clo_1")):
            answer = await composition(caller, method, below, body if method == "POST" else None)
            assert answer.status_code == 403


@pytest.mark.parametrize(("path", "body", "members"), CLOSINGS)
async def test_a_dry_run_makes_nothing(
    composition: Any, path: str, body: Any, members: Any
) -> None:
    tried = await composition(OPERATOR, "POST", f"{path}?dry_run=true", body)

    assert tried.status_code == 200, tried.text
    assert tried.json()["closure_id"] is None
    assert (await composition(OPERATOR, "GET", f"{path}?all=true")).json()["items"] == []
    assert await composition.rows("SELECT conditions FROM networks") == [(0,)]


async def test_a_closure_that_has_ended_is_not_listed(composition: Any) -> None:
    path = "/v1/stations/b/closures"
    until = composition.clock.now() + timedelta(hours=1)
    await composition(OPERATOR, "POST", path, {"until": until.isoformat()})

    composition.clock.advance(timedelta(hours=1))

    assert (await composition(OPERATOR, "GET", path)).json()["items"] == []


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/v1/stations/none/closures", {}, 404),
        ("/v1/stations/b/pads/2/outages", {}, 404),
        ("/v1/segments/a/c/closures", {}, 404),
        ("/v1/zones", {"network_id": "none", "area": SQUARE}, 404),
        ("/v1/zones", {"network_id": "row"}, 422),
        (
            "/v1/zones",
            {"network_id": "row", "area": {"coordinates": [[[0, 0], [0, 1], [1, 1], [1, 0]]]}},
            422,
        ),
        ("/v1/ground-stops", {}, 422),
        ("/v1/ground-stops", {"network_id": "none", "reason": "storm"}, 404),
        ("/v1/stations/b/closures", {"until": "2020-01-01T00:00:00Z"}, 422),
        ("/v1/stations/b/closures", {"until": "2030-01-01T00:00:00"}, 422),
        (
            "/v1/stations/b/closures",
            {"from_at": "2030-01-02T00:00:00Z", "until": "2030-01-01T00:00:00Z"},
            422,
        ),
    ],
)
async def test_an_impossible_closure_is_refused(
    composition: Any, path: str, body: Any, status: int
) -> None:
    for query in ("", "?dry_run=true"):
        answer = await composition(OPERATOR, "POST", path + query, body)
        assert answer.status_code == status, answer.text


async def test_a_closure_can_be_lifted_only_at_its_own_address(composition: Any) -> None:
    made = await composition(OPERATOR, "POST", "/v1/stations/b/closures")
    closure_id = made.json()["closure_id"]

    for path in ("/v1/stations/c/closures", "/v1/stations/b/pads/0/outages", "/v1/zones"):
        answer = await composition(OPERATOR, "DELETE", f"{path}/{closure_id}")
        assert answer.status_code == 404


async def test_closing_and_lifting_change_the_conditions(composition: Any) -> None:
    made = await composition(OPERATOR, "POST", "/v1/stations/b/closures")
    path = f"/v1/stations/b/closures/{made.json()['closure_id']}"
    await composition(OPERATOR, "POST", "/v1/ground-stops", {"reason": "storm"})

    await composition(OPERATOR, "DELETE", path)

    assert await composition.rows("SELECT conditions FROM networks") == [(3,)]
