"""The caller of a request: a service with its own secret, or the person that it speaks for."""

import hmac
import re
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Final, Literal, get_args

from fastapi import Request
from fastapi.openapi.models import HTTPBearer as HTTPBearerModel
from fastapi.security.base import SecurityBase
from fastapi.security.utils import get_authorization_scheme_param

from skyway.runtime.errors import AccessDenied, Unauthenticated
from skyway.runtime.peer_secrets import peer_file, read_secret, secret_hash

CallerRole = Literal["customer", "provider", "operator", "drone", "service"]

#: The header in which a service names its caller; it is trusted only with the service's secret.
CALLER_HEADER: Final = "Skyway-Caller"

#: The only service that callers show their keys to.
_SPEAKS_FOR_OTHERS: Final = "gateway"
#: Prefix of the paths that the gateway forwards for callers.
_OF_PEOPLE: Final = "/v1/"

_SUBJECT: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")


@dataclass(frozen=True, slots=True)
class Caller:
    """A caller: its role, and the subject in that role."""

    role: CallerRole
    subject_id: str

    def __str__(self) -> str:
        return f"{self.role}:{self.subject_id}"

    def must_be(self, *roles: CallerRole) -> None:
        """Go on only for a caller in one of these roles.

        Raises
        ------
        AccessDenied
            The caller is in another role.
        """
        if self.role not in roles:
            raise AccessDenied(f"this is for the role {' or '.join(roles)}, not {self.role}")

    def must_be_service(self, *names: str) -> None:
        """Go on only for one of these services, speaking for itself.

        Raises
        ------
        AccessDenied
            The caller is a person, a drone or another service.
        """
        if self.role != "service" or self.subject_id not in names:
            raise AccessDenied(f"this is for the service {' or '.join(names)}, not {self}")

    @classmethod
    def parse(cls, text: str) -> "Caller":
        """The caller in a `Skyway-Caller` header.

        Raises
        ------
        Unauthenticated
            The text is not ``role:subject``.
        """
        role, _, subject_id = text.partition(":")
        for each in get_args(CallerRole):
            if role == each and _SUBJECT.fullmatch(subject_id):
                return cls(role=each, subject_id=subject_id)
        raise Unauthenticated(f"{CALLER_HEADER} must be role:subject")


#: Why a key is refused; callers see no difference. "slowed": not looked up, because the address has
#: to wait.
RefusalReason = Literal["unknown", "expired", "revoked", "slowed"]


@dataclass(frozen=True, slots=True)
class KeyHolder:
    """The holder of a valid key, and what the key allows.

    Without `scopes` the key allows everything that the caller's role may do. `expires_at` is wall
    time. `is_session` says that a browser's session was shown instead of its key.
    """

    caller: Caller
    key_id: str
    scopes: frozenset[str] | None = None
    expires_at: datetime | None = None
    is_session: bool = False

    @property
    def is_limited(self) -> bool:
        """Whether the key has limits: scopes, or an end."""
        return self.scopes is not None or self.expires_at is not None


@dataclass(frozen=True, slots=True)
class RefusedKey:
    """Why a key is refused, and its holder if the key was valid once."""

    reason: RefusalReason
    holder: KeyHolder | None = None


class ServiceIdentity:
    """How one service proves its identity to others; its secret is read at the first call."""

    def __init__(self, name: str, secrets_dir: Path) -> None:
        self.name = name
        self._secrets_dir = secrets_dir

    @cached_property
    def _secret(self) -> str:
        return read_secret(self._secrets_dir, f"service_{self.name}")

    def headers(self, caller: Caller | None) -> dict[str, str]:
        """The headers of a call on behalf of `caller`, or of the service itself."""
        speaks_for = caller or Caller("service", self.name)
        return {"Authorization": f"Bearer {self._secret}", CALLER_HEADER: str(speaks_for)}


class ServiceGate(SecurityBase):
    """A dependency that accepts only services with a secret, and returns the caller that they name.

    Only the gateway sees keys, so only the gateway may name other callers and call public paths.
    This class is its own security scheme: FastAPI's would be one more dependency to resolve.
    """

    model = HTTPBearerModel(description="the secret of the calling service")
    scheme_name = "HTTPBearer"

    def __init__(self, secrets_dir: Path, allowed: tuple[str, ...]) -> None:
        self._secrets_dir = secrets_dir
        self._allowed = allowed

    @cached_property
    def _hashes(self) -> dict[str, str]:
        return {name: self._hash_of(name) for name in self._allowed}

    def _hash_of(self, name: str) -> str:
        """The hash of a service's secret, from its file or made from the secret."""
        if (self._secrets_dir / peer_file(name)).exists():
            return read_secret(self._secrets_dir, peer_file(name))
        return secret_hash(read_secret(self._secrets_dir, f"service_{name}"))

    async def __call__(self, request: Request) -> Caller:
        """The caller of a request that carries a service's secret."""
        scheme, shown = get_authorization_scheme_param(request.headers.get("Authorization"))
        if scheme.lower() != "bearer" or not shown:
            raise Unauthenticated
        # Every hash is compared, in constant time: the duration must not reveal a match.
        hashed = secret_hash(shown)
        matching = [
            name for name, each in self._hashes.items() if hmac.compare_digest(hashed, each)
        ]
        if not matching:
            raise Unauthenticated("the bearer is not the secret of a service")
        itself = Caller("service", matching[0])
        named = request.headers.get(CALLER_HEADER)
        caller = itself if named is None else Caller.parse(named)
        if itself.subject_id != _SPEAKS_FOR_OTHERS:
            if caller != itself:
                raise AccessDenied(f"{itself} may not speak for {caller}")
            if request.scope["path"].startswith(_OF_PEOPLE):
                raise AccessDenied(f"{itself} may not call what people call")
        return caller
