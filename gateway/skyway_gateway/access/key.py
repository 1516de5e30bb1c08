"""An API key as the operator sees it, and how its secret is made and recognised."""

import hashlib
import secrets
from typing import Annotated, Final, Literal

from pydantic import AwareDatetime, Field

from skyway.ids import KeyId, SubjectId
from skyway.json_model import JsonModel

KeyRole = Literal["customer", "provider", "operator"]

_PREFIX: Final = "sk_"
#: 256 bits: nobody guesses them, so that a fast hash is enough.
_SECRET_BYTES: Final = 32


class NewKey(JsonModel):
    """Whose key is wanted: a customer's own name, a provider's id, or an operator's name."""

    role: KeyRole
    subject_id: SubjectId


class ApiKey(JsonModel):
    """A key, without its secret."""

    key_id: KeyId
    role: KeyRole
    subject_id: SubjectId
    created_at: Annotated[AwareDatetime, Field(description="RFC 3339 UTC, wall time")]


class BrokerLogin(JsonModel):
    """A broker account; a customer's later key gives the same account a new password."""

    user_name: str
    password: str


class IssuedKey(ApiKey):
    """A new key with what is shown only this once; providers have no broker account."""

    key: str
    mqtt: BrokerLogin | None


def new_secret() -> str:
    """A new API key."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def secret_hash(secret: str) -> str:
    """What is stored of an API key, and what a shown one is looked up by."""
    return hashlib.sha256(secret.encode()).hexdigest()
