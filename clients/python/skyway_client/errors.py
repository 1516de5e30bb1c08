"""What is raised when the server refuses a call.

`problems.py`, which is generated, has a subclass for each type of problem, and below it a subclass
for each code: `except problems.OfferLost`.
"""

from collections.abc import Mapping
from typing import Any

import httpx


class SkywayError(Exception):
    """A call that the server refused, with the members of its problem document (RFC 9457)."""

    def __init__(
        self, status: int, members: Mapping[str, Any], retry_after_s: float | None
    ) -> None:
        super().__init__(members.get("detail") or members.get("title") or f"status {status}")
        self.status = status
        self.members = members
        self.type = str(members.get("type", "about:blank"))
        self.code: str | None = members.get("code")
        self.fields: tuple[str, ...] = tuple(
            str(each.get("field")) for each in members.get("errors") or ()
        )
        self.trace_id: str | None = members.get("trace_id")
        self.retry_after_s = retry_after_s


def problem_of(response: httpx.Response) -> SkywayError:
    """The error of the class that fits the type and the code of a problem document."""
    # The generated module imports this one.
    from skyway_client import problems

    members = _members(response)
    kind = problems.BY_TYPE.get(str(members.get("type")), SkywayError)
    by_code = problems.BY_CODE.get(str(members.get("code")), kind)
    chosen = by_code if issubclass(by_code, kind) else kind
    return chosen(response.status_code, members, _retry_after_s(response))


def _members(response: httpx.Response) -> Mapping[str, Any]:
    """The members of the problem document; none if a proxy answered with something else."""
    try:
        members = response.json()
    except ValueError:
        return {}
    return members if isinstance(members, dict) else {}


def _retry_after_s(response: httpx.Response) -> float | None:
    text = response.headers.get("retry-after", "")
    return float(text) if text.isdigit() else None
