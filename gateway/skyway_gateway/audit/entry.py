"""One entry of the audit log, and what of a call's body may stand in it."""

import re
from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment, WallMoment
from skyway.ids import SubjectId
from skyway.json_model import JsonModel
from skyway_gateway.access.key import KeyRole

#: The most of a body and of a path that is kept, bytes and characters.
LONGEST_BODY: Final = 4096
LONGEST_PATH: Final = 500

#: Members whose text is nobody's to read, also where the body was cut inside it.
_SECRET: Final = re.compile(
    r'("(?:\w*(?:password|secret|token)|key)"\s*:\s*)"(?:[^"\\]|\\.)*"?', re.IGNORECASE
)


class AuditEntry(JsonModel):
    """A call by an operator or a provider, and how it was answered.

    `status` is 0 when it was not answered: the caller left, or it broke.
    """

    entry_id: str
    at: FleetMoment
    wall_at: WallMoment
    role: KeyRole
    subject_id: SubjectId
    method: str
    path: Annotated[str, Field(description="with its query")]
    status: int
    body: Annotated[
        str | None, Field(description="as it came, without secrets, cut where it is long")
    ]
    traceparent: str | None


def body_text(raw: bytes) -> str | None:
    """What the log keeps of a body; None when there is none."""
    if not raw:
        return None
    text = raw[:LONGEST_BODY].decode(errors="replace").replace("\0", "\ufffd")
    return _SECRET.sub(r'\1"***"', text)


def path_text(path: str, query: bytes) -> str:
    """What the log keeps of a path and its query."""
    text = f"{path}?{query.decode('latin-1')}" if query else path
    return text[:LONGEST_PATH].encode(errors="replace").decode().replace("\0", "\ufffd")
