"""One public call that another service answers, and what the gateway's document says of it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final, Literal

from skyway.runtime.http.identity import CallerRole

Method = Literal["GET", "POST", "PUT", "PATCH", "DELETE"]
Service = Literal["registry", "composition"]

_PLACEHOLDER: Final = re.compile(r"{(\w+)}")
_BETWEEN_WORDS: Final = re.compile(r"\W+")
_JSON: Final[Mapping[str, Any]] = {"application/json": {"schema": {}}}


@dataclass(frozen=True, slots=True)
class Forwarded:
    """One call: who answers it, and who may make it. `{provider_id}` is a provider's own only.

    Without roles nobody has to say who they are: the body holds the proof.
    """

    method: Method
    path: str
    service: Service
    roles: tuple[CallerRole, ...]
    about: str
    #: How it is answered when all is well, and in which forms.
    statuses: tuple[int, ...] = (200,)
    media_types: tuple[str, ...] = ("application/json",)
    limit_bytes: int | None = None
    timeout_s: float = 30.0

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names in the path."""
        return tuple(_PLACEHOLDER.findall(self.path))

    @property
    def operation_id(self) -> str:
        """Its name in the gateway's document: ``get_v1_networks_network_id``."""
        return _BETWEEN_WORDS.sub("_", f"{self.method.lower()} {self.path}").strip("_")

    @property
    def responses(self) -> dict[int | str, dict[str, Any]]:  # a part of a JSON document
        """Its answers in the gateway's document, as FastAPI takes them."""
        content: dict[str, Any] = {media_type: {} for media_type in self.media_types}
        return {
            status: {"description": HTTPStatus(status).phrase}
            | ({} if status == HTTPStatus.NO_CONTENT else {"content": content})
            for status in self.statuses
        }

    @property
    def openapi(self) -> dict[str, Any]:  # a part of a JSON document
        """What the gateway's document says of it; the service's own document says the rest."""
        described: dict[str, Any] = {
            "summary": self.about,
            "description": f"Answered by the {self.service}: see its document for the bodies.",
            "parameters": [
                {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
                for name in self.parameters
            ],
        }
        if self.method in ("POST", "PUT", "PATCH"):
            described["requestBody"] = {"required": True, "content": dict(_JSON)}
        return described
