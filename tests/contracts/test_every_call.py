"""What holds for every call of the OpenAPI documents."""

import contextlib
import gzip
import json
from typing import Any, Final

import pytest
from pydantic import ValidationError

from skyway.contracts.asyncapi import documented_message, message_schemas
from skyway.contracts.message_examples import message_examples
from skyway.contracts.topics import TOPICS
from tests.contracts.every_call import (
    SERVICES,
    Call,
    calls,
    client_of,
    example_body,
    members_in,
    members_of,
    schemas_of,
)
from tests.long_cases import sampled

#: Values of each JSON type, and texts that only look like one of another type.
VALUES: Final[dict[str, tuple[Any, ...]]] = {
    "string": ("1", "true", "1795428000"),
    "integer": (1, 0, 1795428000),
    "number": (1.5,),
    "boolean": (True, False),
    "null": (None,),
    "object": ({},),
    "array": ([],),
}
JSON: Final = {"Content-Type": "application/json"}
SCALARS: Final = {"string", "integer", "number", "boolean"}

#: Texts that are of no use for a parameter of this type.
WRONG_TEXTS: Final = {
    "integer": ("", "x", "1.5", "true"),
    "number": ("", "x", "true"),
    "boolean": ("", "x", "2"),
    "date-time": ("", "x", "1.5", "1795428000", "2026-03-02", "2026-03-02T09:16:00"),
}


def wrong_values(forms: list[dict[str, Any]]) -> list[Any]:
    """The values whose JSON type none of these forms has; a moment is no other text."""
    kinds = {form.get("type") or ("string" if "enum" in form else None) for form in forms}
    if None in kinds or not kinds & SCALARS:
        return []
    if "number" in kinds:
        kinds.add("integer")
    wrong = [value for kind, values in VALUES.items() if kind not in kinds for value in values]
    is_moment = any(form.get("format") == "date-time" for form in forms)
    return wrong + (["1795428000", "2026-03-02", "2026-03-02T09:16:00"] if is_moment else [])


@pytest.mark.parametrize("values_each", sampled([1, 99], every=2))
@pytest.mark.parametrize("service", SERVICES)
async def test_a_scalar_of_a_wrong_type_is_refused_with_its_name(
    service: str, values_each: int
) -> None:
    """The sample tries one of the wrong values at each member of each call, in turns."""
    tried, wrong = 0, []
    async with client_of(service) as client:
        for call in calls(service):
            if call.body is None:
                continue
            for member in members_of(call):
                values = wrong_values(member.forms)
                turn = tried % len(values) if values else 0
                for value in (values[turn:] + values[:turn])[:values_each]:
                    body = member.changed_to(value)
                    answer = await client.request(call.method, call.url, json=body)
                    tried += 1
                    if fault := fault_of(answer, member.name):
                        wrong.append((str(call), member.name, value, fault))

    members = [each for call in calls(service) if call.body for each in members_of(call)]
    sample = sum(min(values_each, len(wrong_values(each.forms))) for each in members)
    assert tried == sample > 50
    assert not wrong, "\n".join(map(str, wrong))


@pytest.mark.parametrize("name", sampled(message_examples(), every=4))
def test_a_scalar_of_a_wrong_type_makes_a_message_unreadable(name: str) -> None:
    example, schema = message_examples()[name], message_schemas(TOPICS)[name]
    body, read = example.model_dump(mode="json"), []

    for member in members_in(schema, body, body, schema.get("$defs", {})):
        for value in wrong_values(member.forms):
            text = json.dumps(member.changed_to(value))
            with contextlib.suppress(ValidationError):
                type(example).model_validate_json(text, extra="ignore")
                read.append((member.name, value))

    assert not read


async def test_a_member_of_a_patch_is_null_only_where_the_document_says_what_null_does() -> None:
    wrong = []
    for call in (call for call in calls() if call.method == "patch"):
        async with client_of(call.service) as client:
            for member in members_of(call):
                if len(member.place) > 1:
                    continue
                answer = await client.patch(call.url, json={member.name: None})
                about = schemas_of(call)[call.schema_name]["properties"][member.name]["description"]
                if ("null" in about) is (fault_of(answer, member.name) is None):
                    wrong.append((str(call), member.name, answer.status_code))

    assert not wrong


def test_every_object_within_a_patch_is_merged_by_a_test_of_its_own() -> None:
    """An object of a PATCH changes only the members that are sent: see `JsonModel.merged`."""
    objects = {
        (str(call), member.name)
        for call in calls()
        if call.method == "patch"
        for member in members_of(call)
        if any("properties" in form for form in member.forms)
    }

    terms = ("tariff.payment_terms.cancellation", "tariff.payment_terms.waiting")
    tariff = ("tariff", "tariff.payment_terms", *terms)
    step = "tariff.payment_terms.late.0"  # of a list, which is replaced whole
    people = ("recipient", "sender", "packages.0", "packages.0.recipient")
    wishes = ("qos", "qos.providers", "qos.weights")
    # A size has all its sides, and a place is another place: both are replaced whole.
    place = ("packages.0.destination", "packages.0.alternative")
    proof = "packages.0.dropoff_verification"
    whole = ("packages.0.size_mm", *place, *(f"{each}.location" for each in place))
    assert objects == {
        *(("PATCH /v1/providers/{provider_id}", each) for each in (*tariff, step)),
        *(
            ("PATCH /v1/deliveries/{delivery_id}", each)
            for each in (*people, *wishes, proof, *whole)
        ),
    }


def fault_of(answer: Any, field: str) -> str | None:
    """What is wrong with an answer that should refuse this field; None if it does."""
    if answer.status_code != 422:
        return f"{answer.status_code} {answer.text[:100]}"
    fields = [each["field"] for each in answer.json()["errors"]]
    if not any(each == field or each.startswith(f"{field}.") for each in fields):
        return f"names {fields}"
    return None


@pytest.mark.parametrize("service", SERVICES)
async def test_a_parameter_of_a_wrong_type_is_refused_with_its_name(service: str) -> None:
    tried, wrong = 0, []
    async with client_of(service) as client:
        for call in calls(service):
            for parameter in call.query:
                for text in wrong_texts(parameter["schema"]):
                    answer = await client.request(
                        call.method, call.url, params={**required(call), parameter["name"]: text}
                    )
                    tried += 1
                    if fault := fault_of(answer, parameter["name"]):
                        wrong.append((str(call), parameter["name"], text, fault))

    assert tried > 20
    assert not wrong, "\n".join(map(str, wrong))


def wrong_texts(schema: dict[str, Any]) -> tuple[str, ...]:
    forms = schema.get("anyOf", [schema])
    if any("enum" in form or "const" in form for form in forms):
        return ("no such word",)
    kinds = {form.get("format") or form.get("type") for form in forms}
    return next((texts for kind, texts in WRONG_TEXTS.items() if kind in kinds), ())


def required(call: Call) -> dict[str, str]:
    return {each["name"]: "1" for each in call.query if each.get("required")}


@pytest.mark.parametrize("service", SERVICES)
async def test_a_call_that_accepts_no_type_of_its_answers_is_refused_with_their_list(
    service: str,
) -> None:
    wrong: list[tuple[str, str, int]] = []
    async with client_of(service) as client:
        for call in calls(service):
            types = answered_types(call)
            refused = ("font/woff", "font/woff, application/json;q=0", "font/*") if types else ()
            accepted = (*types, "*/*", "text/html, */*;q=0.1", "image/*, application/*, text/*")
            for accept in (*refused, *accepted):
                answer = await client.request(call.method, call.url, headers={"Accept": accept})
                is_refused = answer.status_code == 406
                if is_refused != (accept in refused):
                    wrong.append((str(call), accept, answer.status_code))
                if is_refused and not all(each in answer.json()["detail"] for each in types):
                    wrong.append((str(call), answer.text, answer.status_code))

    assert not wrong


def answered_types(call: Call) -> list[str]:
    return [
        media
        for status, answer in call.operation["responses"].items()
        if status.startswith("2")
        for media in answer.get("content", ())
    ]


@pytest.mark.parametrize("service", SERVICES)
async def test_a_compressed_body_is_refused_with_the_name_of_the_header(service: str) -> None:
    wrong = []
    headers = {**JSON, "Content-Encoding": "gzip"}
    async with client_of(service) as client:
        for call in (call for call in calls(service) if call.body is not None):
            body = gzip.compress(json.dumps(example_body(call)).encode())
            answer = await client.request(call.method, call.url, content=body, headers=headers)
            if answer.status_code != 415 or "Content-Encoding" not in answer.json()["detail"]:
                wrong.append((str(call), answer.status_code, answer.text))

    assert not wrong


@pytest.mark.parametrize("service", SERVICES)
async def test_a_member_that_stands_twice_is_refused_with_its_name(service: str) -> None:
    tried, wrong = 0, []
    async with client_of(service) as client:
        for call in (call for call in calls(service) if call.body is not None):
            for member in members_of(call):
                if isinstance(member.place[-1], int):
                    continue
                text = json.dumps(member.changed_to({"here": None}))
                name = json.dumps(member.place[-1])
                twice = text.replace('{"here": null}', f"1, {name}: 2")
                answer = await client.request(call.method, call.url, content=twice, headers=JSON)
                tried += 1
                if fault := fault_of(answer, member.name):
                    wrong.append((str(call), member.name, fault))
                elif "stands twice" not in answer.json()["detail"]:
                    wrong.append((str(call), member.name, answer.text))

    assert tried > 10
    assert not wrong


@pytest.mark.parametrize("name", message_examples())
def test_a_member_that_stands_twice_makes_a_message_unreadable(name: str) -> None:
    example = message_examples()[name]
    topic = next(each for each in TOPICS if f".{name}" in repr(documented_message(each)))
    text = example.model_dump_json()

    assert topic.read(text.encode())
    for each, value in json.loads(text).items():
        escaped, again = f"\\u{ord(each[0]):04x}{each[1:]}", json.dumps(value)
        for added in (
            f'"{each}": {again}',
            f'"{escaped}": {again}',
            f'"unknown": [{{"a": 1}}, {{"{each}": {{"b": 1, "b" : 2}}}}]',
        ):
            with pytest.raises(ValidationError, match="stands twice in one object"):
                topic.read(f"{text[:-1]}, {added}}}".encode())


@pytest.mark.parametrize("service", SERVICES)
async def test_head_is_answered_like_get_without_a_body(service: str) -> None:
    wrong = []
    async with client_of(service) as client:
        for call in (call for call in calls(service) if call.method == "get"):
            params = {**required(call), "limit": "x", "cursor": "x", "dry_run": "x"}
            get = await client.get(call.url, params=params)
            head = await client.head(call.url, params=params)
            heads = [
                (answer.status_code, answer.headers["content-type"], len(answer.headers))
                for answer in (get, head)
            ]
            if head.content or heads[0] != heads[1]:
                wrong.append((str(call), heads, head.content))

    assert not wrong
