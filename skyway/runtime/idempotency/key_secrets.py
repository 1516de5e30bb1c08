"""What is derived from an Idempotency-Key: nothing that is stored leads back to the key."""

import hashlib
import hmac
import json
from base64 import b64decode, b64encode, urlsafe_b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Self

from cryptography.fernet import Fernet
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from skyway.errors import InvalidInput

_LONGEST_KEY: Final = 255


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP answer as it was first given."""

    status: int
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)
    #: Whether this is a stored answer, given again without any effect.
    is_replayed: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class KeySecrets:
    """The values that are derived from one key within its scope."""

    key_hash: str
    body_key: bytes = field(repr=False)
    answer_key: bytes = field(repr=False)

    @classmethod
    def derive(cls, caller: str, route: str, key: str) -> Self:
        """The secrets of this caller's key on this route.

        Raises
        ------
        InvalidInput
            The key is empty or longer than 255 characters.
        """
        if not 0 < len(key) <= _LONGEST_KEY:
            raise InvalidInput("Idempotency-Key", f"1 to {_LONGEST_KEY} characters, got {len(key)}")
        # JSON distinguishes ("ab", "c") from ("a", "bc").
        scope = json.dumps([caller, route]).encode()
        derived = HKDF(SHA256(), length=96, salt=None, info=scope).derive(key.encode())
        return cls(derived[:32].hex(), derived[32:64], derived[64:])

    def body_hash(self, body: bytes) -> bytes:
        """A hash that identifies the body, and that nobody can compute without the key."""
        return hmac.digest(self.body_key, body, hashlib.sha256)

    def seal(self, answer: Answer) -> bytes:
        """The answer, encrypted so that only the key opens it."""
        text = json.dumps([answer.status, b64encode(answer.body).decode(), dict(answer.headers)])
        return self._fernet().encrypt(text.encode())

    def unseal(self, sealed: bytes) -> Answer:
        """The sealed answer, marked as given again."""
        status, body, headers = json.loads(self._fernet().decrypt(sealed))
        return Answer(status, b64decode(body), headers, is_replayed=True)

    def _fernet(self) -> Fernet:
        return Fernet(urlsafe_b64encode(self.answer_key))
