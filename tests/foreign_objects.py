"""The calls of OpenAPI documents about one object, for tests that ask for another tenant's."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

_FOLDER = Path(__file__).parents[1] / "openapi"


@dataclass(frozen=True, slots=True)
class Call:
    """A call of the document, with a body that fits it."""

    method: str
    path: str
    body: Any  # any JSON value

    def url(self, **ids: str) -> str:
        """The path with these ids."""
        return self.path.format(**ids)

    def __str__(self) -> str:
        return f"{self.method} {self.path}"


def calls_about(document: str, name: str, *, role: str) -> Iterator[Call]:
    """The calls of a service with this id in their path that the gateway lets a role make."""
    stated = _paths("gateway")
    for path, item in _paths(document).items():
        for method, operation in item.items():
            about = stated.get(path, {}).get(method, {}).get("description", "")
            callers = re.search(r"Callers: ([\w, ]+)\.", about)
            if f"{{{name}}}" in path and callers and role in callers[1]:
                content = operation.get("requestBody", {}).get("content", {})
                body = content.get("application/json", {}).get("example")
                yield Call(method.upper(), path, body)


def learned_from(answer: httpx.Response, object_id: str) -> tuple[int, str]:
    """What a caller learns from an answer, without the object's id and the id of the trace."""
    text = answer.text.replace(object_id, "ID")
    return answer.status_code, re.sub(r'"trace_id": "\w+"', "", text)


def _paths(document: str) -> dict[str, Any]:
    text = (_FOLDER / f"{document}.json").read_text(encoding="utf-8")
    paths: dict[str, Any] = json.loads(text)["paths"]
    return paths
