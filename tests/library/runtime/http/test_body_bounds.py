"""Bodies are counted before they are parsed: a valid body passes, a larger one is refused."""

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Annotated, Any, Final

import pytest
from fastapi.exceptions import RequestValidationError
from pydantic import Field, TypeAdapter, ValidationError
from skyway_composition.app import openapi_app as composition_app
from skyway_gateway.app import openapi_app as gateway_app
from skyway_lab.benchmarks.hostile.worst_bodies import worst_bodies
from skyway_provider_registry.app import openapi_app as registry_app

from skyway.json_model import JsonModel
from skyway.runtime.http.body_bounds import BodyBounds, BodyText
from skyway.runtime.http.service_router import InternalBody, ServiceRoute, require_storable

#: The most errors that pydantic may make of one body: each takes some microseconds.
MOST_ERRORS: Final = 1_700


#: How often the text of one body may be looked at, by its whole length: each takes up to a tenth of
#: a millisecond, and removing escapes more than one.
MOST_PASSES: Final = 16


class Counted(bytes):
    """A text that counts how many of its bytes are looked at, and how often it is rewritten."""

    looked_at = 0
    rewritten = 0

    def replace(self, *given: Any) -> "Counted":
        Counted.rewritten += 1
        return self._looked(super().replace(*given))

    def translate(self, *given: Any) -> "Counted":
        return self._looked(super().translate(*given))

    def count(self, *given: Any) -> int:
        self._looked(self)
        return super().count(*given)

    def __contains__(self, form: object) -> bool:
        self._looked(self)
        return super().__contains__(form)  # type: ignore[operator] # bytes, as all forms

    def _looked(self, made: bytes) -> "Counted":
        Counted.looked_at += len(self)
        return Counted(made)


class Parcel(JsonModel):
    label: Annotated[str, Field(max_length=200)]
    sizes: Annotated[tuple[int, ...], Field(max_length=300)] = ()


class Parcels(JsonModel):
    parcels: Annotated[tuple[Parcel, ...], Field(max_length=3)]


BOUNDS: Final = BodyBounds.of_type(Parcels)


def routes_with_body() -> Iterator[tuple[str, ServiceRoute, TypeAdapter[Any]]]:
    """Each route whose body FastAPI or `internal_body` validates, and the type of its body."""
    for app in (gateway_app(), registry_app(), composition_app()):
        for route in app.routes:
            if isinstance(route, ServiceRoute) and (body := type_of_body(route)) is not None:
                yield f"{app.title}: {route.methods} {route.path}", route, body


def type_of_body(route: ServiceRoute) -> TypeAdapter[Any] | None:
    if route.body_field is not None:
        field = route.body_field.field_info
        annotation: Any = Annotated[field.annotation, field]  # of any body
        return TypeAdapter(annotation)
    for each in route.dependant.dependencies:
        if isinstance(each.call, InternalBody):
            return TypeAdapter(each.call.model)
    return None


def errors_in(body: TypeAdapter[Any], raw: bytes) -> int:
    try:
        body.validate_python(json.loads(raw))
    except ValidationError as error:
        return error.error_count()
    except (ValueError, RecursionError):
        return 1
    return 0


def test_no_wrong_body_makes_many_errors_or_values(subtests: pytest.Subtests) -> None:
    for name, route, body in routes_with_body():
        schema = body.json_schema()
        definitions, bounds = schema.get("$defs", {}), route.bounds
        with subtests.test(name):
            for kind, raw in worst_bodies(schema, definitions, limit_bytes=bounds.size_bytes):
                if bounds.excess(BodyText(raw)) is None:
                    assert errors_in(body, raw) <= MOST_ERRORS, kind


def test_no_body_is_looked_at_often(subtests: pytest.Subtests) -> None:
    for name, route, body in routes_with_body():
        schema = body.json_schema()
        definitions, bounds = schema.get("$defs", {}), route.bounds
        with subtests.test(name):
            for kind, raw in worst_bodies(schema, definitions, limit_bytes=bounds.size_bytes):
                Counted.looked_at = Counted.rewritten = 0
                text = BodyText(Counted(raw))
                if bounds.excess(text) is None:
                    with suppress(ValueError, RecursionError, RequestValidationError):
                        require_storable(text, json.loads(raw), most_members=bounds.members)
                assert Counted.looked_at <= MOST_PASSES * len(raw), kind
                assert Counted.rewritten <= 2, kind


def test_a_long_number_is_searched_for_its_length_only() -> None:
    text = BodyText(Counted(b"9" * 10_000))
    Counted.looked_at = 0

    with pytest.raises(RequestValidationError):
        require_storable(text, math.inf, most_members=0)

    # For a zero byte, for a backslash, for its digits, and for a long number.
    assert Counted.looked_at <= 4 * 10_000


def test_only_bodies_between_services_may_hold_many_values() -> None:
    public = [route for name, route, _ in routes_with_body() if "/internal/" not in name]
    limits = {route.path: route.bounds.values for route in public}

    areas = ("/v1/zones", "/v1/ground-stops")
    signature = "/track/{delivery_id}/{token}/proof"
    assert {path for path, values in limits.items() if values > 4_500} == {*areas, signature}


def test_the_largest_valid_body_is_within_its_bounds() -> None:
    parcel = {"label": "\u00e4" * 200, "sizes": [2**62] * 300}

    raw = json.dumps({"parcels": [parcel] * 3}).encode()

    assert len(raw) <= BOUNDS.size_bytes
    assert BOUNDS.excess(BodyText(raw)) is None


@pytest.mark.parametrize(
    "raw",
    [
        b"[" * 2_000,
        b"[" + b"1," * 1_000 + b"1]",
        b"[" + b"{}," * 1_000 + b"{}]",
        b"[" + b'"",' * 1_000 + b'""]',
        b'{"parcels": [' + b'{"a":1},' * 1_000 + b"{}]}",
    ],
)
def test_a_body_with_too_many_values_or_texts_is_refused_unparsed(raw: bytes) -> None:
    assert BOUNDS.excess(BodyText(raw)) is not None


def test_one_text_more_than_the_bound_is_refused() -> None:
    bounds = BodyBounds(1_000, values=100, texts=8)

    assert bounds.excess(BodyText(json.dumps(["x"] * 8).encode())) is None
    assert bounds.excess(BodyText(json.dumps(["x"] * 9).encode())) is not None


@pytest.mark.parametrize("text", [",[{" * 60, '"' * 200, "\\" * 200, '\\"' * 100])
def test_brackets_and_quotes_within_a_text_do_not_count(text: str) -> None:
    raw = json.dumps({"parcels": [{"label": text, "sizes": [1] * 300}] * 3}).encode()

    assert BOUNDS.excess(BodyText(raw)) is None


def test_a_schema_that_holds_itself_is_bounded_by_the_bytes() -> None:
    schema = {"$ref": "#/$defs/Tree"}
    tree = {"type": "array", "maxItems": 2, "items": {"$ref": "#/$defs/Tree"}}

    bounds = BodyBounds.of_schema(schema, {"Tree": tree}, limit_bytes=8_000)

    assert (bounds.size_bytes, bounds.values) == (8_000, 500)
