"""One entry of the audit log, and the part of a call's body that it may hold."""

import re
from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment, WallMoment
from skyway.ids import SubjectId
from skyway.json_model import JsonModel
from skyway_gateway.access.key import KeyRole

#: The longest body (bytes) and path (characters) in an entry; longer ones are cut.
LONGEST_BODY: Final = 4096
LONGEST_PATH: Final = 500

#: JSON members with secret text, also where the body is cut inside that text.
_SECRET: Final = re.compile(
    r'("(?:\w*(?:password|secret|token)|key)"\s*:\s*)"(?:[^"\\]|\\.)*"?', re.IGNORECASE
)


class AuditEntry(JsonModel):
    """A call of an operator or a provider, and its answer."""

    entry_id: Annotated[
        str, Field(description="The id of the entry; later entries have larger ids.")
    ]
    at: FleetMoment
    wall_at: WallMoment
    role: Annotated[KeyRole, Field(description="The role of the caller.")]
    subject_id: Annotated[SubjectId, Field(description="Who called: a provider or an operator.")]
    method: Annotated[str, Field(description="The HTTP method of the call.")]
    path: Annotated[str, Field(description="with its query")]
    status: Annotated[
        int, Field(description="The HTTP status of the answer; 0 when the call was not answered.")
    ]
    body: Annotated[
        str | None, Field(description="as it came, without secrets, cut where it is long")
    ]
    traceparent: Annotated[str | None, Field(description="The W3C trace context of the call.")]


def body_text(raw: bytes) -> str | None:
    """The text of a body for the log, without secrets; None for an empty body."""
    if not raw:
        return None
    text = raw[:LONGEST_BODY].decode(errors="replace").replace("\0", "\ufffd")
    return _SECRET.sub(r'\1"***"', text)


def path_text(path: str, query: bytes) -> str:
    """The text of a path and its query for the log."""
    text = f"{path}?{query.decode('latin-1')}" if query else path
    return text[:LONGEST_PATH].encode(errors="replace").decode().replace("\0", "\ufffd")
