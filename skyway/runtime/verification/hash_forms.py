"""Readers of what is stored of secrets: they show a hash or token that was cut or overwritten."""

import base64
import re
from typing import Final

_SHA256: Final = re.compile(r"[0-9a-f]{64}")
#: Version, time, initial vector and signature of a Fernet token; its text comes in whole blocks.
_FERNET_FRAME_BYTES: Final = 1 + 8 + 16 + 32
_FERNET_BLOCK_BYTES: Final = 16
_FERNET_VERSION: Final = 0x80


def read_sha256(text: str) -> str:
    """The text of a SHA-256.

    Raises
    ------
    ValueError
        It is not 64 hexadecimal digits.
    """
    if _SHA256.fullmatch(text) is None:
        raise ValueError("not a SHA-256")
    return text


def read_fernet_token(sealed: bytes) -> bytes:
    """The bytes of a Fernet token; nobody can read its text without its key.

    Raises
    ------
    ValueError
        It is not a whole token.
    """
    token = base64.urlsafe_b64decode(sealed)
    text_bytes = len(token) - _FERNET_FRAME_BYTES
    is_whole = text_bytes > 0 and text_bytes % _FERNET_BLOCK_BYTES == 0
    if not is_whole or token[0] != _FERNET_VERSION:
        raise ValueError("not a whole Fernet token")
    return token
