"""How a message between cloud and drone is signed: the form of its bytes, without cryptography.

A signed message is a JSON object whose last member is its signature (Ed25519, base64url without
padding)::

    {"schema_version":1, ... ,"signature":"5y0f..."}

The signed bytes are ``skyway-v1``, a line feed, the topic's name, a line feed, and the payload up
to the comma before ``"signature"``. So a signature holds for one topic only: for one drone, and for
one kind of message.
"""

import base64
import binascii
from typing import Annotated, Final, NamedTuple

from pydantic import Field

from skyway.json_model import WireModel

_DOMAIN: Final = b"skyway-v1\n"
_BEFORE: Final = b',"signature":"'
_AFTER: Final = b'"}'
_SIGNATURE_BYTES: Final = 64
#: A signature has 64 bytes, which are 86 characters of base64url.
_TEXT_BYTES: Final = 86
_TAIL_BYTES: Final = len(_BEFORE) + _TEXT_BYTES + len(_AFTER)

#: An Ed25519 public key.
PublicKey = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z0-9_-]{43}$",
        max_length=43,
        description="Ed25519 public key: 32 bytes in base64url without padding.",
        examples=["11qYAYKxCrfVS_7TyWQHOg7hcvPapiMlrwIaaPcHURo"],
    ),
]


class CloudKeys(WireModel):
    """The keys with which the cloud's services sign; more than one while a key is replaced."""

    composition: Annotated[
        tuple[PublicKey, ...],
        Field(description="Sign instructions, versions of networks and states of stations."),
    ]
    gateway: Annotated[tuple[PublicKey, ...], Field(description="Sign the fleet clock.")]


class SignedPayload(NamedTuple):
    """A payload's signed part and its signature."""

    head: bytes
    signature: bytes


def signed_bytes(topic_name: str, head: bytes) -> bytes:
    """The signed bytes of a payload that begins with `head` on this topic."""
    return b"".join((_DOMAIN, topic_name.encode(), b"\n", head))


def head_of(payload: bytes) -> bytes:
    """The part of an unsigned JSON object that is signed: everything but the last brace."""
    return payload.rstrip()[:-1]


def payload_with(head: bytes, signature: bytes) -> bytes:
    """The payload with its signature as the last member."""
    text = base64.urlsafe_b64encode(signature).rstrip(b"=")
    return b"".join((head, _BEFORE, text, _AFTER))


def split(payload: bytes) -> SignedPayload | None:
    """The signed part and the signature; None if the payload does not end with a signature."""
    head, tail = payload[:-_TAIL_BYTES], payload[-_TAIL_BYTES:]
    if not (head and tail.startswith(_BEFORE) and tail.endswith(_AFTER)):
        return None
    try:
        signature = base64.b64decode(
            tail[len(_BEFORE) : -len(_AFTER)] + b"==", altchars=b"-_", validate=True
        )
    except binascii.Error:
        return None
    return SignedPayload(head, signature) if len(signature) == _SIGNATURE_BYTES else None
