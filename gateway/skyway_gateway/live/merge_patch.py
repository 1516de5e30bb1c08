"""JSON merge patches (RFC 7396): what must change in a JSON object to make it another."""

from collections.abc import Mapping
from typing import Any

#: A JSON object without nulls: in a patch, null removes a member.
JsonObject = Mapping[str, Any]


def patch_between(before: JsonObject, after: JsonObject) -> dict[str, Any]:
    """The patch that turns `before` into `after`; empty when they are equal.

    Objects are compared member by member. Arrays are replaced as a whole, as RFC 7396 says.
    """
    patch: dict[str, Any] = dict.fromkeys(before.keys() - after.keys())
    for name, value in after.items():
        earlier = before.get(name)
        if value == earlier:
            continue
        if isinstance(value, dict) and isinstance(earlier, dict):
            patch[name] = patch_between(earlier, value)
        else:
            patch[name] = value
    return patch
