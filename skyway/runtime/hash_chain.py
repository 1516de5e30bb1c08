"""Chains of hashes: each hash covers an entry and the hash before it.

So no entry can be changed, removed or added without changing all hashes after it. The hashes have
no key: they show damage, but not a change after which all hashes were computed again.
"""

import hashlib


def next_hash(previous: str, *parts: str) -> str:
    """The hash of an entry with these parts after the entry with the hash `previous`.

    The first entry follows the empty text.
    """
    hashed = hashlib.sha256(previous.encode())
    for part in parts:
        text = part.encode()
        # The length before each part keeps its end from passing for the start of the next part.
        hashed.update(b"%d:" % len(text))
        hashed.update(text)
    return hashed.hexdigest()
