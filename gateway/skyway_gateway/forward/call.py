"""One public call that another service answers; its own document describes it."""

from dataclasses import dataclass
from typing import Literal

from skyway.runtime.http.identity import CallerRole

Method = Literal["GET", "POST", "PUT", "PATCH", "DELETE"]
Service = Literal["registry", "composition"]


@dataclass(frozen=True, slots=True)
class Forwarded:
    """One call: who answers it, and who may make it. `{provider_id}` is a provider's own only.

    Without roles nobody has to say who they are: the body holds the proof.
    """

    method: Method
    path: str
    service: Service
    roles: tuple[CallerRole, ...]
    limit_bytes: int | None = None
    timeout_s: float = 30.0
