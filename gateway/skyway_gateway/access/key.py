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

    role: Annotated[KeyRole, Field(description="Who the key is for.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="A customer's own name, a provider's id, or an operator's name."),
    ]


class ApiKey(JsonModel):
    """A key, without its secret."""

    key_id: Annotated[KeyId, Field(description="The id of the key, which is not secret.")]
    role: Annotated[KeyRole, Field(description="Who the key is for.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="The customer's name, the provider's id or the operator's name."),
    ]
    created_at: Annotated[AwareDatetime, Field(description="RFC 3339 UTC, wall time")]


class BrokerLogin(JsonModel):
    """A broker account; each new key of a customer gives the same account a new password."""

    user_name: Annotated[str, Field(description="The user name at the broker.")]
    password: Annotated[
        str, Field(description="The password; a later key of the same customer replaces it.")
    ]


class IssuedKey(ApiKey):
    """A new key with its secrets, which are shown only once."""

    key: Annotated[
        str, Field(description="The secret key for `Authorization: Bearer`; it is shown only once.")
    ]
    mqtt: Annotated[
        BrokerLogin | None,
        Field(description="The broker account; null for providers, which have none."),
    ]


def new_secret() -> str:
    """A new API key."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def secret_hash(secret: str) -> str:
    """The hash of an API key: it is stored instead of the key, and finds a shown key."""
    return hashlib.sha256(secret.encode()).hexdigest()
