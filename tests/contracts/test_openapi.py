"""The committed documents are those that the code generates, and they are valid."""

import functools
import importlib.util
import json
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator, FormatChecker
from openapi_spec_validator import OpenAPIV31SpecValidator

from skyway.contracts.asyncapi import asyncapi_document, documented_message, message_schemas
from skyway.contracts.message_examples import message_examples
from skyway.contracts.topics import TOPICS, Topic
from tests.long_cases import sampled

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "openapi"
LARGEST = ("gateway", "composition")
SERVICES = (*LARGEST, "provider-registry")


def load_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "write_openapi", ROOT / "tools" / "write_openapi.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TOOL = load_tool()


def document_of(service: str) -> Any:
    return json.loads((FOLDER / f"{service}.json").read_text(encoding="utf-8"))


@functools.cache
def asyncapi() -> Any:
    """The committed AsyncAPI document, read once. Tests do not change it."""
    return yaml.safe_load((FOLDER / "asyncapi.yaml").read_text(encoding="utf-8"))


def references_in(value: object) -> Iterator[str]:
    if isinstance(value, dict):
        if isinstance(value.get("$ref"), str):
            yield value["$ref"]
        for inner in value.values():
            yield from references_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from references_in(inner)


def resolve(document: Any, reference: str) -> Any:
    found = document
    for part in reference.removeprefix("#/").split("/"):
        found = found[part.replace("~1", "/").replace("~0", "~")]
    return found


def test_the_committed_openapi_documents_are_those_of_the_apps() -> None:
    for path, generated in TOOL.service_files():
        assert (ROOT / path).read_text(encoding="utf-8") == generated, f"{path}: make openapi"


def test_every_list_is_answered_as_csv() -> None:
    document = document_of("gateway")
    schemas, without = document["components"]["schemas"], []
    for path, operations in document["paths"].items():
        content = operations.get("get", {}).get("responses", {}).get("200", {}).get("content", {})
        for reference in references_in(content.get("application/json")):
            is_list = "items" in schemas[reference.rpartition("/")[2]].get("properties", {})
            if is_list and "text/csv" not in content:
                without.append(path)
    assert without == []


@pytest.mark.parametrize(
    "service",
    sampled(["provider-registry", *LARGEST], every=3),
)
def test_an_openapi_document_is_valid_3_1(service: str) -> None:
    """The sample is the smallest document: one generator writes all."""
    document = document_of(service)

    OpenAPIV31SpecValidator(document).validate()

    assert document["openapi"].startswith("3.1")


@pytest.mark.parametrize("service", SERVICES)
def test_every_call_documents_its_problems(service: str) -> None:
    document = document_of(service)
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            assert ("requestBody" in operation) <= ("400" in operation["responses"])
            assert "default" in operation["responses"], (path, method)
            for status, answer in operation["responses"].items():
                if not status.startswith("2"):
                    shown = resolve(document, answer["$ref"]) if "$ref" in answer else answer
                    problem = shown["content"]["application/problem+json"]
                    assert problem["schema"]["$ref"].endswith("/ProblemDetails"), (path, method)


@pytest.mark.parametrize("service", SERVICES)
def test_every_call_says_what_it_does(service: str) -> None:
    for path, operations in document_of(service)["paths"].items():
        for method, operation in operations.items():
            assert operation.get("description"), (path, method)


def test_the_committed_messages_are_those_of_the_topics() -> None:
    committed = {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for path in (FOLDER / "asyncapi.yaml", *FOLDER.glob("messages/*"))
    }

    assert committed == dict(TOOL.message_files()), "make openapi"


def test_asyncapi_has_a_channel_and_an_operation_for_every_topic() -> None:
    document = asyncapi()

    channels = {channel["address"]: name for name, channel in document["channels"].items()}
    operated = {
        operation["channel"]["$ref"]: operation for operation in document["operations"].values()
    }

    assert document["asyncapi"] == "3.0.0"
    assert set(channels) == {topic.template for topic in TOPICS}
    assert len(document["operations"]) == len(TOPICS)
    for topic in TOPICS:
        operation = operated[f"#/channels/{channels[topic.template]}"]
        mqtt = operation["bindings"]["mqtt"]
        assert (mqtt["qos"], mqtt["retain"]) == (topic.mqtt_qos, topic.retained)
        assert operation["action"] == ("receive" if topic.writer == "drone" else "send")
        assert f"write: {topic.writer}" in operation["description"].replace("the drone", "drone")


def test_every_reference_of_asyncapi_resolves() -> None:
    document = asyncapi()

    references = set(references_in(document))

    assert references
    for reference in references:
        assert isinstance(resolve(document, reference), dict), reference


def test_an_operation_only_sends_what_its_channel_holds() -> None:
    document = asyncapi()

    for operation in document["operations"].values():
        channel = operation["channel"]["$ref"]
        held = {f"{channel}/messages/{name}" for name in resolve(document, channel)["messages"]}
        assert {message["$ref"] for message in operation["messages"]} == held


def test_every_placeholder_of_a_channel_is_explained() -> None:
    for channel in asyncapi()["channels"].values():
        placeholders = set(re.findall(r"\{(\w+)\}", channel["address"]))
        assert set(channel.get("parameters", {})) == placeholders


def test_every_message_has_a_valid_schema_and_an_example_that_fits_it() -> None:
    examples = message_examples()
    schemas = message_schemas(TOPICS)

    assert set(schemas) == set(examples)
    for name, schema in schemas.items():
        Draft202012Validator.check_schema(schema)
        validator = Draft202012Validator(schema, format_checker=FormatChecker())
        validator.validate(examples[name].model_dump(mode="json"))


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: str(topic.template))
def test_the_examples_of_a_topic_are_read_back_as_themselves(topic: Topic[Any]) -> None:
    # The repr of a message type names the model, or each model of a union.
    forms = repr(documented_message(topic))
    examples = [example for name, example in message_examples().items() if f".{name}" in forms]

    assert examples
    for example in examples:
        written = example.model_dump_json()
        assert json.loads(topic.read(written.encode()).model_dump_json()) == json.loads(written)


def test_the_document_does_not_depend_on_when_it_is_made() -> None:
    first, second = (json.dumps(asyncapi_document(TOPICS, version="1")) for _ in range(2))

    assert first == second


@pytest.mark.parametrize("service", ["provider-registry", "composition"])
def test_the_gateway_promises_the_good_answers_of_the_services_that_it_forwards_to(
    service: str,
) -> None:
    gateway = document_of("gateway")["paths"]
    for path, operations in document_of(service)["paths"].items():
        for method, operation in operations.items():
            if path.startswith("/v1/"):
                promised = gateway[path][method]
                assert good_answers(promised) == good_answers(operation), (method, path)


def good_answers(operation: Any) -> dict[str, set[str]]:
    """The media types of each status 2xx."""
    return {
        status: set(answer.get("content", ()))
        for status, answer in operation["responses"].items()
        if status.startswith("2")
    }


def test_every_discriminator_of_asyncapi_names_a_property_that_differs_by_form() -> None:
    document = asyncapi()
    choices = [
        schema
        for schema in schemas_in(document["components"]["schemas"])
        if "discriminator" in schema
    ]

    assert choices
    for schema in choices:
        name = schema["discriminator"]
        forms = [resolve(document, form["$ref"]) for form in schema["oneOf"]]
        values = [form["properties"][name]["const"] for form in forms]
        assert len(values) == len(set(values)), name


def schemas_in(value: object) -> Iterator[Any]:
    """The objects within a JSON value, the value itself too."""
    if isinstance(value, dict):
        yield value
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            yield from schemas_in(each)
