"""Which JSON bodies are accepted and which are refused."""

from collections.abc import Callable

import httpx
import pytest


@pytest.mark.parametrize(
    ("raw", "status", "name"),
    [
        (b'{"price": ', 400, "broken-json"),
        (b"\xff\xfe{", 400, "broken-json"),
        ('{"price": 1}'.encode("utf-16"), 400, "broken-json"),
        (b'{"notes": {"a": "\xed\xa0\x80"}}', 400, "broken-json"),
        (b'{"price": ' + b"9" * 5000 + b"}", 422, "invalid-input"),
        (b"[" * 100_000, 422, "invalid-input"),
        (b'"text"', 422, "invalid-input"),
        (b"", 422, "invalid-input"),
        (b"null", 422, "invalid-input"),
    ],
)
async def test_an_invalid_body_is_refused(
    client: httpx.AsyncClient,
    raw: bytes,
    status: int,
    name: str,
    assert_is_problem: Callable[..., None],
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=raw, headers=headers)

    assert_is_problem(answer, status, name)


@pytest.mark.parametrize(
    ("raw", "field"),
    [
        (b'{"crates": [{"mass_kg": NaN}]}', "crates.0.mass_kg"),
        (b'{"notes": {"a": [1, -Infinity]}}', "notes.a.1"),
        (b'{"notes": {"a": 1e999}}', "notes.a"),
        (b'{"price": 9223372036854775808}', "price"),
        (b'{"notes": {"a": "\\u0000"}}', "notes.a"),
        (b'{"notes": {"a": "\\ud800"}}', "notes.a"),
        (b'{"notes": {"\\u0000": 1}}', "notes"),
        (b'{"notes": {"a": "\\u001b]0;title\\u0007"}}', "notes.a"),
        (b'{"notes": {"a": "\\b"}}', "notes.a"),
        (b'{"notes": {"a": "\x7f"}}', "notes.a"),
        (b'{"notes": {"a": "\xc2\x9b2J"}}', "notes.a"),
        (b'{"notes": ' + b'{"a":' * 200 + b"1" + b"}" * 201, "body"),
    ],
)
async def test_a_value_that_no_database_can_store_is_refused_with_its_field(
    client: httpx.AsyncClient,
    raw: bytes,
    field: str,
    assert_is_problem: Callable[..., None],
    fields_at_fault: Callable[..., list[str]],
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=raw, headers=headers)

    assert_is_problem(answer, 422, "invalid-input")
    assert fields_at_fault(answer) == [field]


async def test_a_field_name_that_is_no_text_is_still_answered(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=b'{"\\ud800": 1}', headers=headers)

    assert_is_problem(answer, 422, "invalid-input")


async def test_emoji_in_escapes_pass(client: httpx.AsyncClient) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post(
        "/loads", content=b'{"notes": {"a": "\\ud83d\\ude80"}}', headers=headers
    )

    assert answer.json()["notes"] == {"a": "\N{ROCKET}"}


@pytest.mark.parametrize("kind", ["application/x-www-form-urlencoded", "text/plain", ""])
async def test_a_body_of_another_type_is_refused(
    client: httpx.AsyncClient, kind: str, assert_is_problem: Callable[..., None]
) -> None:
    headers = {"content-type": kind} if kind else {}

    answer = await client.post("/loads", content=b'{"price": 1}', headers=headers)

    assert_is_problem(answer, 415, "unsupported-media-type")


async def test_a_route_that_reads_its_own_body_answers_the_same_problems(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    json_type = {"Content-Type": "application/json"}
    for body, status, name in (
        (b"", 400, "broken-json"),
        (b"[1,", 400, "broken-json"),
        (b"[NaN]", 422, "invalid-input"),
        (b"[" * 100_000, 422, "invalid-input"),
    ):
        answer = await client.put("/raw", content=body, headers=json_type)
        assert_is_problem(answer, status, name)


async def test_a_body_that_a_route_reads_by_itself_must_say_that_it_is_json(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    geojson = {"Content-Type": "application/geo+json"}

    assert (await client.put("/raw", content=b"[1]", headers=geojson)).json() == [1]
    for kind in ("", "text/plain"):
        headers = {"Content-Type": kind} if kind else {}
        answer = await client.put("/raw", content=b"[1]", headers=headers)
        assert_is_problem(answer, 415, "unsupported-media-type")


async def test_an_internal_body_may_hold_unknown_fields(client: httpx.AsyncClient) -> None:
    body = {"order_id": "o1", "newer": 1, "load": {"price": 1, "newer": {}}}

    answer = await client.put("/internal/orders", json=body)

    assert answer.json() == "o1"


async def test_a_body_is_counted_before_it_is_parsed(client: httpx.AsyncClient) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=b"[" + b"1," * 40_000, headers=headers)

    assert answer.json()["errors"] == [{"field": "body", "detail": "holds more than 16,384 values"}]


@pytest.mark.parametrize(
    ("body", "status", "name"),
    [
        (b"{", 400, "broken-json"),
        (b"", 400, "broken-json"),
        (b"[" * 10_000, 400, "broken-json"),
        (b'{"order_id": "o1", "load": {"price": "x"}}', 422, "invalid-input"),
        (b'{"order_id": "o1", "load": {"price": ' + b"9" * 5000 + b"}}", 400, "broken-json"),
    ],
)
async def test_an_internal_body_at_fault_is_a_problem(
    client: httpx.AsyncClient,
    body: bytes,
    status: int,
    name: str,
    assert_is_problem: Callable[..., None],
    fields_at_fault: Callable[..., list[str]],
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.put("/internal/orders", content=body, headers=headers)

    assert_is_problem(answer, status, name)
    assert status == 400 or fields_at_fault(answer) == ["load.price"]
