"""API keys as operators see them, and how a secret is made and recognised."""

import hashlib
import secrets
from typing import Annotated, Final, Literal

from pydantic import AwareDatetime, Field

from skyway.ids import KeyId, SubjectId
from skyway.json_model import JsonModel

KeyRole = Literal["customer", "provider", "operator"]

_PREFIX: Final = "sk_"
#: 256 bits cannot be guessed, so a fast hash is enough.
_SECRET_BYTES: Final = 32


class NewKey(JsonModel):
    """The key to issue: its role, and the customer, provider or operator that it is for."""

    role: KeyRole
    subject_id: SubjectId


class ApiKey(JsonModel):
    """A key, without its secret."""

    key_id: KeyId
    role: KeyRole
    subject_id: SubjectId
    created_at: Annotated[AwareDatetime, Field(description="RFC 3339 UTC, wall time")]


class BrokerLogin(JsonModel):
    """A broker account; each new key of a customer gives the same account a new password."""

    user_name: str
    password: str


class IssuedKey(ApiKey):
    """A new key with its secrets, which are shown only once."""

    key: str
    mqtt: BrokerLogin | None


def new_secret() -> str:
    """A new API key."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def secret_hash(secret: str) -> str:
    """The hash of an API key: it is stored instead of the key, and finds a shown key."""
    return hashlib.sha256(secret.encode()).hexdigest()
