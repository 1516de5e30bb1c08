"""What a customer's tools need of openapi/gateway.json: ids, schemas, examples, descriptions."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from skyway.contracts.problem_details import CONFLICT_CODES
from skyway.contracts.rest_tags import TAGS

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT: dict[str, Any] = json.loads((ROOT / "openapi" / "gateway.json").read_text("utf-8"))
SCHEMAS: dict[str, Any] = DOCUMENT["components"]["schemas"]
#: Of all properties, at least this share has a description.
DESCRIBED = 0.95


def operations() -> Iterator[tuple[str, Any]]:
    """The name of each operation, and the operation itself."""
    for path, methods in DOCUMENT["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def contents() -> Iterator[tuple[str, str, Any]]:
    """The name, media type and content of each body and of each good answer."""
    for name, operation in operations():
        for media, content in operation.get("requestBody", {}).get("content", {}).items():
            yield f"{name} body", media, content
        for status, answer in operation["responses"].items():
            for media, content in answer.get("content", {}).items():
                yield f"{name} {status}", media, content
    for name, methods in DOCUMENT["webhooks"].items():
        for media, content in methods["post"]["requestBody"]["content"].items():
            yield f"webhook {name}", media, content


def examples_in(content: Any) -> list[Any]:
    """The examples of a body or an answer."""
    if "example" in content:
        return [content["example"]]
    return [example["value"] for example in content.get("examples", {}).values()]


def test_every_operation_has_a_short_id_of_its_own() -> None:
    ids = [operation["operationId"] for _, operation in operations()]

    assert len(ids) == len(set(ids))
    assert len(ids) > 80
    assert {"createDelivery", "listStations"} <= set(ids)
    assert all(re.fullmatch(r"[a-z]+([A-Z][a-z]*)*", each) for each in ids)


def test_every_operation_has_one_tag_that_is_described() -> None:
    described = {tag["name"]: tag["description"] for tag in DOCUMENT["tags"]}

    assert all(described.values())
    assert set(described) < set(TAGS)
    for name, operation in operations():
        assert len(operation["tags"]) == 1, name
        assert operation["tags"][0] in described, name


def test_the_document_names_its_servers_and_no_internal_call() -> None:
    assert DOCUMENT["servers"]
    assert not [path for path in DOCUMENT["paths"] if path.startswith("/internal")]
    assert "internal" not in {tag["name"] for tag in DOCUMENT["tags"]}


def test_every_body_and_every_answer_has_a_schema() -> None:
    for name, media, content in contents():
        assert content["schema"], (name, media)
        if "json" in media:
            assert set(content["schema"]) & {"$ref", "anyOf", "oneOf", "properties"}, name


def test_every_write_says_what_its_body_is() -> None:
    without_body = {
        name
        for name, operation in operations()
        if name.split()[0] in ("POST", "PUT", "PATCH") and "requestBody" not in operation
    }

    assert without_body == {
        "POST /v1/deliveries/{delivery_id}/packages/{package_id}/proof",
        "POST /v1/deliveries/{delivery_id}/tracking-link",
        "POST /v1/keys/rotations",
        "POST /v1/providers/{provider_id}/drones/{drone_id}/enrolment-tokens",
        "POST /v1/providers/{provider_id}/drones/{drone_id}/maintenance",
        "POST /v1/quarantine/{quarantine_id}/replay",
        "POST /v1/session-links",
        "POST /v1/small-world",
        "POST /v1/webhooks/{webhook_id}/secret-rotations",
        "POST /v1/webhooks/{webhook_id}/test",
    }


def test_every_body_and_every_answer_has_an_example_that_fits_its_schema() -> None:
    for name, media, content in contents():
        examples = examples_in(content)
        assert examples, (name, media)
        if "json" in media:
            schema = {**content["schema"], "components": DOCUMENT["components"]}
            for example in examples:
                errors = [
                    error.message for error in Draft202012Validator(schema).iter_errors(example)
                ]
                assert not errors, (name, media, errors[:3])


def test_every_problem_answer_has_examples_of_its_types_and_codes() -> None:
    for name, operation in operations():
        for status, answer in operation["responses"].items():
            if status.startswith("2"):
                continue
            shared = answer.get("$ref", "").rpartition("/")[2]
            shown = DOCUMENT["components"]["responses"][shared] if shared else answer
            examples = examples_in(shown["content"]["application/problem+json"])
            assert examples, (name, status)
            for example in examples:
                assert example["type"] in shown["description"], (name, status)
                assert status in (str(example["status"]), "default"), (name, status)
            if status == "409":
                assert [example["code"] for example in examples] == shown["x-codes"], name


def test_every_whole_number_of_a_body_has_a_largest_value() -> None:
    """A number that no column holds would break a statement far from the call."""
    schemas = DOCUMENT["components"]["schemas"]
    sent = json.dumps([each.get("requestBody", {}) for _, each in operations()])
    reached: dict[str, str] = {}
    while new := set(re.findall(r'schemas/(\w+)"', sent)) - reached.keys():
        reached |= {name: json.dumps(schemas[name]) for name in new}
        sent = "".join(reached.values())

    unbounded = [
        f"{name}.{field}"
        for name in sorted(reached)
        for field, given in schemas[name].get("properties", {}).items()
        for each in (given, *given.get("anyOf", ()))
        if each.get("type") == "integer" and not {"maximum", "exclusiveMaximum"} & each.keys()
    ]

    assert unbounded == []


def test_every_code_of_a_conflict_is_described_and_shown_by_an_operation() -> None:
    raised = {
        code
        for folder in ("gateway", "services")
        for path in (ROOT / folder).rglob("*.py")
        for code in re.findall(r"Conflict\(\s*\"([A-Z_]+)\"", path.read_text("utf-8"))
    }
    shown = {
        code
        for _, operation in operations()
        for code in operation["responses"].get("409", {}).get("x-codes", ())
    }

    assert raised == set(CONFLICT_CODES)
    # Only reports between services come too early, and only the tracking page has a lock.
    assert shown == raised - {"NOT_YET", "PROOF_LOCKED"}


def test_nearly_every_property_is_described() -> None:
    properties = {
        f"{name}.{each}": "description" in schema
        for name, model in SCHEMAS.items()
        for each, schema in model.get("properties", {}).items()
    }

    missing = [name for name, is_described in properties.items() if not is_described]

    assert len(missing) <= (1 - DESCRIBED) * len(properties), missing


def test_every_schema_and_every_parameter_is_described() -> None:
    undescribed = [name for name, schema in SCHEMAS.items() if "description" not in schema]
    undescribed += [
        f"{name} {parameter['name']}"
        for name, operation in operations()
        for parameter in operation.get("parameters", ())
        if "description" not in parameter
    ]

    assert not undescribed


def test_every_delivery_event_has_a_schema_of_its_own() -> None:
    body = DOCUMENT["webhooks"]["delivery-event"]["post"]["requestBody"]["content"]
    schema = body["application/json"]["schema"]

    types = set(schema["discriminator"]["mapping"])

    assert types == set(SCHEMAS["DeliveryEventType"]["enum"])
    for kind, reference in schema["discriminator"]["mapping"].items():
        form = SCHEMAS[reference.rpartition("/")[2]]
        assert form["properties"]["type"]["const"] == kind
        assert form["properties"]["data"]["$ref"]


def test_every_moment_is_of_the_fleets_clock_unless_its_name_says_wall() -> None:
    """A customer sees one clock: `docs/reference/time.md` says which moments need the other."""
    wrong = []
    for name, model in SCHEMAS.items():
        for field, schema in model.get("properties", {}).items():
            if any(
                each.get("format") == "date-time" for each in (schema, *schema.get("anyOf", ()))
            ):
                is_wall = "wall time" in schema.get("description", "").lower()
                if is_wall != field.endswith("wall_at"):
                    wrong.append(f"{name}.{field}")

    assert not wrong
