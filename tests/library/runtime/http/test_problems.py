"""Each error becomes the problem document that its caller gets."""

from collections.abc import Callable

import httpx
import pytest

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"


@pytest.mark.parametrize(
    ("name", "status", "kind"),
    [
        ("invalid", 422, "invalid-input"),
        ("unauthenticated", 401, "unauthenticated"),
        ("denied", 403, "access-denied"),
        ("missing", 404, "not-found"),
        ("conflict", 409, "conflict"),
        ("taken", 409, "taken"),
        ("changed", 412, "precondition-failed"),
        ("large", 413, "too-large"),
        ("spent", 429, "too-many-requests"),
        ("reused", 422, "idempotency-key-reused"),
        ("away", 503, "service-unavailable"),
        ("broker", 503, "service-unavailable"),
    ],
)
async def test_each_error_has_its_problem(
    client: httpx.AsyncClient,
    name: str,
    status: int,
    kind: str,
    assert_is_problem: Callable[..., None],
) -> None:
    answer = await client.get(f"/errors/{name}")

    assert_is_problem(answer, status, kind)


async def test_a_remote_problem_passes_unchanged(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/remote")

    assert answer.status_code == 409
    assert answer.json() == {"type": "urn:x", "title": "No", "status": 409, "why": 7}


async def test_a_bug_is_a_500_that_shows_nothing_of_the_inside(
    client: httpx.AsyncClient,
    caplog: pytest.LogCaptureFixture,
    assert_is_problem: Callable[..., None],
) -> None:
    headers = {"traceparent": f"00-{TRACE_ID}-00f067aa0ba902b7-01"}

    answer = await client.get("/errors/bug", headers=headers)

    assert_is_problem(answer, 500, "internal-error")
    assert "inside" not in answer.text
    assert answer.json()["trace_id"] == TRACE_ID
    assert "request failed" in caplog.text


async def test_a_conflict_names_its_code(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/conflict")

    assert answer.json()["code"] == "TOO_LATE"
    assert answer.json()["detail"] == "it has left"


async def test_an_unauthenticated_caller_is_asked_for_a_bearer(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/unauthenticated")

    assert answer.headers["www-authenticate"] == "Bearer"


async def test_every_field_at_fault_is_named(
    client: httpx.AsyncClient,
    assert_is_problem: Callable[..., None],
    fields_at_fault: Callable[..., list[str]],
) -> None:
    body = {"crates": [{"mass_kg": 1}, {"mass_kg": -1}, {}], "colour": "red"}

    answer = await client.post("/loads", json=body)

    assert_is_problem(answer, 422, "invalid-input")
    assert sorted(fields_at_fault(answer)) == ["colour", "crates.1.mass_kg", "crates.2.mass_kg"]
    assert "must be at least 0" in answer.text


async def test_a_query_parameter_at_fault_is_named_by_itself(
    client: httpx.AsyncClient, fields_at_fault: Callable[..., list[str]]
) -> None:
    answer = await client.get("/loads", params={"limit": 201})

    assert fields_at_fault(answer) == ["limit"]


async def test_the_arms_of_a_union_are_not_named_as_fields(
    client: httpx.AsyncClient, fields_at_fault: Callable[..., list[str]]
) -> None:
    answer = await client.post("/mixed", json=[{"price": "much"}])

    assert "0.price" in fields_at_fault(answer)
    assert not [field for field in fields_at_fault(answer) if "list" in field or "Load" in field]


async def test_the_answer_to_a_wrong_method_names_the_allowed_methods(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    answer = await client.patch("/loads")

    assert_is_problem(answer, 405, "method-not-allowed")
    assert answer.headers["allow"] == "DELETE, GET, HEAD, POST"
    assert answer.json()["detail"] == (
        "PATCH is no method of this path, which has DELETE, GET, HEAD, POST"
    )


async def test_an_unknown_path_is_a_problem(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    answer = await client.get("/nowhere")

    assert_is_problem(answer, 404, "not-found")
    assert answer.json()["detail"] == "no call has the path /nowhere; GET /openapi.json lists all"
    assert_is_problem(await client.get("/loads/"), 404, "not-found")
