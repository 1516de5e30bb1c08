"""Descriptions that an OpenAPI document has somewhere, shown where a reader looks for them."""

from http import HTTPStatus
from typing import Any, Final

from skyway.drone.model import ChargePoint
from skyway.geo import Position

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]

#: What FastAPI says of an answer of which nothing is said.
_UNSAID: Final = "Successful Response"
#: Models of which pydantic shows no docstring.
_TUPLES: Final = (Position, ChargePoint)
_REPEATABLE: Final = (
    "Repeats are answered like the first call with this key and body, for 24 hours; "
    "1 to 255 characters."
)
_HEADERS: Final = {
    "idempotency-key": _REPEATABLE,
    "if-match": "The ETag of the version that is to be replaced; another version is refused.",
    "last-event-id": "The id of the last event received; the stream goes on after it.",
    "accept": "The media type wanted.",
}


def complete_descriptions(document: Document) -> None:
    """Describe properties, parameters and answers by what their types already say."""
    schemas = document["components"]["schemas"]
    for model in _TUPLES:
        if model.__name__ in schemas:
            schemas[model.__name__].setdefault("description", str(model.__doc__))
    for schema in schemas.values():
        for each in schema.get("properties", {}).values():
            _describe(each)
    for operations in document["paths"].values():
        for operation in operations.values():
            for parameter in operation.get("parameters", ()):
                _describe_parameter(parameter)
            for status, answer in operation["responses"].items():
                if answer.get("description") in (_UNSAID, ""):
                    answer["description"] = _said(status, answer, schemas)


def _describe(schema: Document) -> None:
    """A value that may be null is described by its other form."""
    forms = schema.get("anyOf", ())
    described = [form for form in forms if "description" in form and "$ref" not in form]
    if len(described) == 1:
        about = described[0]["description"]
        forms[forms.index(described[0])] = {
            name: value for name, value in described[0].items() if name != "description"
        }
        schema.setdefault("description", about)


def _describe_parameter(parameter: Document) -> None:
    schema = parameter["schema"]
    _describe(schema)
    about = schema.pop("description", None) or _HEADERS.get(parameter["name"].lower())
    if about is not None:
        parameter.setdefault("description", about)


def _said(status: str, answer: Document, schemas: Document) -> str:
    """The first paragraph about the answer's schema."""
    for media in answer.get("content", {}).values():
        name = media.get("schema", {}).get("$ref", "").rpartition("/")[2]
        if name in schemas and "description" in schemas[name]:
            about: str = schemas[name]["description"]
            return " ".join(about.split("\n\n", maxsplit=1)[0].split())
    return "Done; the answer has no body." if status == "204" else HTTPStatus(int(status)).phrase
