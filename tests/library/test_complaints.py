"""What is wrong with a field is said in Skyway's words, for every kind of error."""

from typing import Annotated, Any, Literal, get_args

import pytest
from pydantic import Field, HttpUrl, TypeAdapter, ValidationError
from pydantic_core.core_schema import ErrorType

from skyway.bounds import Moment
from skyway.complaints import fault_of, sentence_of, unknown_name
from skyway.geo import Position
from skyway.json_model import JsonModel

#: What pydantic and Python say, and nobody else.
FOREIGN = ("input", "dictionary", "tuple", "permitted", "none", "string", "timezone", "unable")

#: A limit for each name that an error may have.
LIMITS = dict.fromkeys(
    (
        *("gt", "ge", "lt", "le", "multiple_of", "min_length", "max_length", "actual_length"),
        *("pattern", "expected", "discriminator", "expected_tags", "expected_schemes", "error"),
    ),
    7,
)


class Example(JsonModel):
    """One field of each kind."""

    count: Annotated[int, Field(ge=1, le=9)] = 1
    share: Annotated[float, Field(gt=0, lt=1)] = 0.5
    is_open: bool = False
    name: Annotated[str, Field(min_length=2, max_length=3, pattern="^[a-z]+$")] = "ab"
    kind: Literal["A", "B"] = "A"
    at: Moment | None = None
    place: Position = Position(0, 0)
    items: Annotated[tuple[float, ...], Field(min_length=1, max_length=2)] = (1.0,)
    url: HttpUrl | None = None
    inner: dict[str, int] | None = None


@pytest.mark.parametrize("kind", get_args(ErrorType))
def test_no_kind_of_error_is_said_in_pydantics_words(kind: str) -> None:
    said = sentence_of({"type": kind, "msg": "Input should be foreign", "ctx": LIMITS})

    assert not [word for word in FOREIGN if word in said.lower()]


@pytest.mark.parametrize(
    ("body", "field", "said"),
    [
        ({"count": 10}, "count", "must be at most 9"),
        ({"count": "5"}, "count", "must be a whole number"),
        ({"count": 1.5}, "count", "must be a whole number"),
        ({"count": True}, "count", "must be a whole number"),
        ({"share": 0}, "share", "must be above 0"),
        ({"share": "0.5"}, "share", "must be a number"),
        ({"share": False}, "share", "must be a number"),
        ({"is_open": 1}, "is_open", "must be true or false"),
        ({"is_open": "true"}, "is_open", "must be true or false"),
        ({"name": 5}, "name", "must be text"),
        ({"name": "a"}, "name", "must have at least 2 characters"),
        ({"name": "A1"}, "name", "must match the pattern ^[a-z]+$"),
        ({"kind": "a"}, "kind", "must be 'A' or 'B'"),
        ({"at": 1.5}, "at", "must be a moment like 2026-03-02T09:16:00Z"),
        ({"at": "2026-13-02T09:16:00Z"}, "at", "must be a moment like 2026-03-02T09:16:00Z"),
        ({"place": [1]}, "place.1", "is missing"),
        ({"place": ["1", 2]}, "place.0", "must be a number"),
        ({"place": [1, 2, 3]}, "place", "must have at most 2 items; it has more"),
        ({"items": []}, "items", "must have at least 1 items; it has 0"),
        ({"url": "no"}, "url", "must be a URL"),
        ({"inner": []}, "inner", "must be an object"),
        ({"surprise": 1}, "surprise", "is not a known field"),
    ],
)
def test_a_wrong_value_is_answered_with_its_field_and_limit(
    body: Any, field: str, said: str
) -> None:
    with pytest.raises(ValidationError) as refused:
        TypeAdapter(Example).validate_python(body)

    (complaint,) = refused.value.errors()
    found, sentence = fault_of(complaint)
    assert found == field
    assert sentence.startswith(said)


def test_an_error_of_our_own_keeps_its_words() -> None:
    own = {"type": "whole_number", "msg": "must be a whole number", "ctx": {}}

    assert sentence_of(own) == "must be a whole number"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("san-marco", "no station is called 'san-marco'; did you mean 'san-marcos'?"),
        ("sanmarcos", "no station is called 'sanmarcos'; did you mean 'san-marcos'?"),
        ("San-Marcos", "no station is called 'San-Marcos'; did you mean 'san-marcos'?"),
        ("kylle", "no station is called 'kylle'; did you mean 'kyle'?"),
        ("vienna", "no station is called 'vienna'"),
        ("", "no station is called ''"),
    ],
)
def test_a_wrong_name_is_answered_with_the_nearest_known_one(name: str, said: str) -> None:
    assert unknown_name("station", name, ["kyle", "san-marcos", "san-antonio"]) == said
