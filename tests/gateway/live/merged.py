"""What a viewer makes of an event stream: JSON merge patches applied to one document."""

import json
from typing import Any


def merged(document: Any, patch: Any) -> Any:
    """The document after a JSON merge patch, as RFC 7396 describes it."""
    if not isinstance(patch, dict):
        return patch
    result = dict(document) if isinstance(document, dict) else {}
    for name, value in patch.items():
        if value is None:
            result.pop(name, None)
        else:
            result[name] = merged(result.get(name), value)
    return result


def event_of(frame: bytes) -> tuple[str, str, Any]:
    """The id, the name and the data of an event."""
    number, name, data = frame.decode().strip().split("\n")
    return (
        number.removeprefix("id: "),
        name.removeprefix("event: "),
        json.loads(data.removeprefix("data: ")),
    )


def shown_after(frames: list[bytes]) -> Any:
    """The document of a viewer who has received these events; kinds without items are left out."""
    document: Any = {}
    for frame in frames:
        _, name, data = event_of(frame)
        document = data if name == "snapshot" else merged(document, data)
    return {kind: items for kind, items in document.items() if items}
