"""The public key that a drone registers for its signatures, as a member of requests."""

from typing import Annotated

from pydantic import AfterValidator, Field

from skyway.contracts.signature import PublicKey
from skyway.errors import InvalidInput
from skyway.runtime.signing.key_pair import public_key_bytes


def _on_curve(key: str | None) -> str | None:
    """The key, if it is one; a `ValueError` if it is none."""
    try:
        if key is not None:
            public_key_bytes(key)
    except InvalidInput as error:
        raise ValueError(error.detail) from error
    return key


#: The public key of a drone that signs, None of a drone that does not.
SigningKey = Annotated[
    PublicKey | None,
    AfterValidator(_on_curve),
    Field(
        description="the drone's Ed25519 public key: its messages are believed only with a valid "
        "signature from then on. A drone that has signed before cannot leave it out"
    ),
]
