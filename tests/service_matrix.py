"""The calls of a service's OpenAPI document, for tests that try who gets in."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: What every process shows of itself.
_OPEN = {"/healthz", "/readyz", "/metrics"}


def guarded_calls(document: str) -> Iterator[tuple[str, str, Any]]:
    """The method, the path with ids that do not exist, and a body, of each call with callers."""
    text = (Path(__file__).parents[1] / "openapi" / f"{document}.json").read_text(encoding="utf-8")
    for path, item in json.loads(text)["paths"].items():
        for method, operation in item.items():
            if method != "parameters" and path not in _OPEN:
                content = operation.get("requestBody", {}).get("content", {})
                body = content.get("application/json", {}).get("example")
                yield method.upper(), re.sub(r"\{\w+\}", "1", path), body
