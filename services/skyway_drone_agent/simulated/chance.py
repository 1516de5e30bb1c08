"""Chance that can be asked again: the same question always has the same answer."""

import math
from hashlib import blake2b
from struct import unpack
from typing import Final

#: So many numbers come with one answer; a hash of 64 bytes holds no more of 8 bytes each.
NUMBERS: Final = 8


def uniforms(seed: int, *about: object) -> tuple[float, ...]:
    """Numbers in (0, 1), evenly spread, that depend on the seed and on what they are about."""
    question = "\x1f".join((str(seed), *map(str, about)))
    integers = unpack(f"<{NUMBERS}Q", blake2b(question.encode(), digest_size=64).digest())
    return tuple((integer + 0.5) / 2.0**64 for integer in integers)


def normals(seed: int, *about: object) -> tuple[float, ...]:
    """Numbers from the normal distribution with mean 0 and deviation 1, by Box and Muller."""
    numbers: list[float] = []
    even = uniforms(seed, *about)
    for radius, turn in zip(even[::2], even[1::2], strict=True):
        length = math.sqrt(-2.0 * math.log(radius))
        numbers += (length * math.cos(math.tau * turn), length * math.sin(math.tau * turn))
    return tuple(numbers)


def happens(share: float, seed: int, *about: object) -> bool:
    """Whether what happens in this share of all cases happens in this one."""
    return share > 0.0 and uniforms(seed, *about)[0] < share
