"""An enrolment token: how it is made, and what is stored of it."""

import hashlib
import secrets
from datetime import timedelta
from typing import Final

_PREFIX: Final = "enr_"
#: 256 bits: nobody guesses them, so that a fast hash is enough.
_SECRET_BYTES: Final = 32

#: How long a token can be exchanged, wall time.
TOKEN_LIFE: Final = timedelta(days=30)


def new_token() -> str:
    """A new enrolment token."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def token_hash(token: str) -> str:
    """What is stored of a token, and what a shown one is looked up by."""
    return hashlib.sha256(token.encode()).hexdigest()
