"""The calls of the public API, each with extreme values, made from its OpenAPI document."""

import json
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlencode

from skyway_lab.benchmarks.hostile.bodies import (
    alternatives,
    places,
    sample,
    value_at,
    with_all_fields,
    with_value,
)
from skyway_lab.benchmarks.hostile.extremes import (
    UNREADABLE,
    all_texts,
    extreme_text,
    extremes_for,
    with_extremes,
)

_DOCUMENT: Final = Path(__file__).parents[4] / "openapi" / "gateway.json"
_METHODS: Final = ("get", "post", "put", "patch", "delete")
#: How often a parameter is extreme, a query is given, a body stays as it is or is not readable.
_EXTREME_PARAMETER: Final = 0.3
_QUERY: Final = 0.5
_BODY_AS_IT_IS: Final = 0.1
_BODY_UNREADABLE: Final = 0.1


@dataclass(frozen=True, slots=True)
class Body:
    """A right body of an operation, and the same with every field of its schema."""

    example: Any  # any JSON value
    full: Any  # any JSON value


@dataclass(frozen=True, slots=True)
class Call:
    """An operation: its method, its path with the names of its parameters, and right bodies."""

    method: str
    path: str
    path_names: tuple[str, ...]
    query_names: tuple[str, ...]
    bodies: tuple[Body, ...] = ()

    @property
    def name(self) -> str:
        """The method and the path, for people."""
        return f"{self.method.upper()} {self.path}"


@dataclass(frozen=True, slots=True)
class Forged:
    """A call that is ready to be sent; `target` is the path with its query, encoded."""

    call: Call
    target: str
    body: bytes | None


@dataclass(frozen=True, slots=True)
class Variant:
    """A call of which one thing is extreme: a parameter, a field of the body, or the whole body."""

    call: Call
    parameter: str = ""
    text: str = ""
    body: Any = None  # any JSON value
    raw: bytes | None = None

    def forged(self, known: Mapping[str, Sequence[str]], chance: random.Random) -> Forged:
        """The call with ids that exist wherever else one is wanted."""
        path = self.call.path
        for name in self.call.path_names:
            is_extreme = name == self.parameter or not known.get(name)
            value = self.text or "x" if is_extreme else chance.choice(known[name])
            path = path.replace(f"{{{name}}}", _in_path(value))
        query = {self.parameter: self.text} if self.parameter in self.call.query_names else {}
        body = self.raw
        if body is None and self.body is not None:
            body = json.dumps(_at_known_places(self.body, known, chance)).encode()
        return Forged(self.call, _target(path, query), body)


def all_calls() -> tuple[Call, ...]:
    """All operations of the public API, in the order of their document."""
    document = json.loads(_DOCUMENT.read_text())
    schemas = document["components"]["schemas"]
    return tuple(
        _call(method, path, item, item[method], schemas)
        for path, item in document["paths"].items()
        for method in _METHODS
        if method in item
    )


def _call(
    method: str,
    path: str,
    item: Mapping[str, Any],
    operation: Mapping[str, Any],
    schemas: Mapping[str, Any],
) -> Call:
    parameters = [*item.get("parameters", ()), *operation.get("parameters", ())]
    content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
    return Call(
        method,
        path,
        tuple(each["name"] for each in parameters if each["in"] == "path"),
        tuple(each["name"] for each in parameters if each["in"] == "query"),
        tuple(_bodies(content, schemas)) if content else (),
    )


def _bodies(content: Mapping[str, Any], schemas: Mapping[str, Any]) -> Iterator[Body]:
    first, *others = alternatives(content.get("schema", {}))
    example = content.get("example")
    if example is None:
        example = sample(first, schemas)
    yield Body(example, with_all_fields(example, first, schemas))
    for other in others:
        full = sample(other, schemas)
        yield Body(full, full)


def every_variant(call: Call) -> Iterator[Variant]:
    """The call with each extreme value at each place, and once as it is."""
    bodies = call.bodies or (Body(None, None),)
    right = bodies[0].example
    yield Variant(call, body=right)
    for name in (*call.path_names, *call.query_names):
        for text in all_texts():
            yield Variant(call, name, text, body=right)
    if call.bodies:
        for raw in UNREADABLE:
            yield Variant(call, raw=raw)
    for body in call.bodies:
        for place in places(body.full):
            for value in extremes_for(value_at(body.full, place)):
                # Null would be no body at all.
                if place or value is not None:
                    changed = with_value(body.example, body.full, place, value)
                    yield Variant(call, body=changed)


def forged_calls(
    calls: Sequence[Call], known: Mapping[str, Sequence[str]], chance: random.Random
) -> Iterator[Forged]:
    """First every variant of every call in random order, then several changes at a time, endlessly.

    `known` has by the name of a parameter the ids that exist; they stand in bodies too.
    """
    variants = [each for call in calls for each in every_variant(call)]
    chance.shuffle(variants)
    for variant in variants:
        yield variant.forged(known, chance)
    while True:
        for call in chance.sample(calls, len(calls)):
            yield _forged(call, known, chance)


def _forged(call: Call, known: Mapping[str, Sequence[str]], chance: random.Random) -> Forged:
    path = call.path
    for name in call.path_names:
        path = path.replace(f"{{{name}}}", _path_value(name, known, chance))
    query = {name: extreme_text(chance) for name in call.query_names if chance.random() < _QUERY}
    return Forged(call, _target(path, query), _body(call, known, chance))


def _target(path: str, query: Mapping[str, str]) -> str:
    encoded = urlencode(query, errors="replace")
    return f"{path}?{encoded}" if encoded else path


def _path_value(name: str, known: Mapping[str, Sequence[str]], chance: random.Random) -> str:
    ids = known.get(name)
    is_extreme = not ids or chance.random() < _EXTREME_PARAMETER
    return _in_path(extreme_text(chance) if is_extreme or not ids else chance.choice(ids))


def _in_path(value: str) -> str:
    """The value as one segment of a path."""
    # An empty segment, or one of dots, would be another path.
    return quote(value[:2_000], safe="", errors="replace") if value.strip(".") else "%00"


def _body(call: Call, known: Mapping[str, Sequence[str]], chance: random.Random) -> bytes | None:
    if not call.bodies:
        return None
    kind = chance.random()
    if kind < _BODY_UNREADABLE:
        return chance.choice(UNREADABLE)
    body = _at_known_places(chance.choice(call.bodies).full, known, chance)
    if kind > _BODY_UNREADABLE + _BODY_AS_IT_IS:
        body = with_extremes(body, chance)
    return json.dumps(body).encode()


def _at_known_places(
    value: Any,  # any JSON value
    known: Mapping[str, Sequence[str]],
    chance: random.Random,
) -> Any:
    """The value with ids that exist, where its members have the name of a parameter."""
    match value:
        case dict():
            return {
                name: chance.choice(known[name])
                if isinstance(inner, str) and known.get(name)
                else _at_known_places(inner, known, chance)
                for name, inner in value.items()
            }
        case list():
            return [_at_known_places(inner, known, chance) for inner in value]
        case _:
            return value
