"""The calls of the public API, each with extreme values, made from its OpenAPI document."""

import json
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlencode

from benchmarks.hostile.extremes import UNREADABLE, extreme_text, with_extremes

_DOCUMENT: Final = Path(__file__).parents[2] / "openapi" / "gateway.json"
_METHODS: Final = ("get", "post", "put", "patch", "delete")
#: How often a parameter is extreme, a query is given, a body stays as it is or is not readable.
_EXTREME_PARAMETER: Final = 0.3
_QUERY: Final = 0.5
_BODY_AS_IT_IS: Final = 0.1
_BODY_UNREADABLE: Final = 0.1


@dataclass(frozen=True, slots=True)
class Call:
    """An operation: its method, its path with the names of its parameters, and a right body."""

    method: str
    path: str
    path_names: tuple[str, ...]
    query_names: tuple[str, ...]
    body: Any  # any JSON value; None without a body

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


def all_calls() -> tuple[Call, ...]:
    """All operations of the public API, in the order of their document."""
    document = json.loads(_DOCUMENT.read_text())
    return tuple(
        _call(method, path, item, item[method])
        for path, item in document["paths"].items()
        for method in _METHODS
        if method in item
    )


def _call(method: str, path: str, item: Mapping[str, Any], operation: Mapping[str, Any]) -> Call:
    parameters = [*item.get("parameters", ()), *operation.get("parameters", ())]
    content = operation.get("requestBody", {}).get("content", {})
    return Call(
        method,
        path,
        tuple(each["name"] for each in parameters if each["in"] == "path"),
        tuple(each["name"] for each in parameters if each["in"] == "query"),
        content.get("application/json", {}).get("example"),
    )


def forged_calls(
    calls: Sequence[Call], known: Mapping[str, Sequence[str]], chance: random.Random
) -> Iterator[Forged]:
    """All calls in random order, again and again, without end.

    `known` has by the name of a parameter the ids that exist; they stand in bodies too.
    """
    while True:
        for call in chance.sample(calls, len(calls)):
            yield _forged(call, known, chance)


def _forged(call: Call, known: Mapping[str, Sequence[str]], chance: random.Random) -> Forged:
    path = call.path
    for name in call.path_names:
        path = path.replace(f"{{{name}}}", _path_value(name, known, chance))
    query = {name: extreme_text(chance) for name in call.query_names if chance.random() < _QUERY}
    encoded = urlencode(query, errors="replace")
    return Forged(call, f"{path}?{encoded}" if encoded else path, _body(call, known, chance))


def _path_value(name: str, known: Mapping[str, Sequence[str]], chance: random.Random) -> str:
    ids = known.get(name)
    is_extreme = not ids or chance.random() < _EXTREME_PARAMETER
    value = extreme_text(chance)[:2_000] if is_extreme or not ids else chance.choice(ids)
    # An empty segment, or one of dots, would be another path.
    return quote(value, safe="", errors="replace") if value.strip(".") else "%00"


def _body(call: Call, known: Mapping[str, Sequence[str]], chance: random.Random) -> bytes | None:
    if call.body is None:
        return None
    kind = chance.random()
    if kind < _BODY_UNREADABLE:
        return chance.choice(UNREADABLE)
    body = _at_known_places(call.body, known, chance)
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
