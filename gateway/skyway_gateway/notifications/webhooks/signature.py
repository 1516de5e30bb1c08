"""Standard Webhooks signatures (standardwebhooks.com, version 1.0.0)."""

import base64
import hashlib
import hmac
import secrets
from datetime import datetime
from typing import Final

_SECRET_PREFIX: Final = "whsec_"  # noqa: S105  a public prefix
#: The specification asks for 24 to 64 bytes.
_SECRET_BYTES: Final = 32


def new_webhook_secret() -> str:
    """A new signing secret in the form that libraries of Standard Webhooks expect."""
    return _SECRET_PREFIX + base64.b64encode(secrets.token_bytes(_SECRET_BYTES)).decode()


def signed_headers(secret: str, *, webhook_id: str, at: datetime, body: bytes) -> dict[str, str]:
    """The three headers that prove the sender, the message and its age to a receiver."""
    timestamp = str(int(at.timestamp()))
    key = base64.b64decode(secret.removeprefix(_SECRET_PREFIX))
    signed = f"{webhook_id}.{timestamp}.".encode() + body
    signature = base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
    return {
        "webhook-id": webhook_id,
        "webhook-timestamp": timestamp,
        "webhook-signature": f"v1,{signature}",
    }
