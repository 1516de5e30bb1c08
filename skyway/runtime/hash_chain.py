"""Chains of hashes: each hash covers an entry and the hash before it.

So no entry can be changed, removed or added without changing all hashes after it. The hashes have
no key: they show damage, but not the work of somebody who computes them again.
"""

import hashlib


def next_hash(previous: str, *parts: str) -> str:
    """The hash of an entry with these parts after the entry with the hash `previous`.

    The first entry follows the empty text.
    """
    hashed = hashlib.sha256(previous.encode())
    for part in parts:
        text = part.encode()
        # With its length before it, no part can pass for the beginning of the next.
        hashed.update(b"%d:" % len(text))
        hashed.update(text)
    return hashed.hexdigest()
