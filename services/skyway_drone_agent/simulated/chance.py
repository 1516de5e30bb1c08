"""Repeatable chance: the same question always has the same answer."""

import math
from hashlib import blake2b
from struct import unpack
from typing import Final

#: Numbers in one answer: a hash of 64 bytes holds 8 numbers of 8 bytes.
NUMBERS: Final = 8


def uniforms(seed: int, *about: object) -> tuple[float, ...]:
    """Uniform numbers in (0, 1) that depend only on the seed and the question."""
    question = "\x1f".join((str(seed), *map(str, about)))
    integers = unpack(f"<{NUMBERS}Q", blake2b(question.encode(), digest_size=64).digest())
    return tuple((integer + 0.5) / 2.0**64 for integer in integers)


def normals(seed: int, *about: object) -> tuple[float, ...]:
    """Normal numbers with mean 0 and deviation 1, by the Box-Muller transform."""
    numbers: list[float] = []
    even = uniforms(seed, *about)
    for radius, turn in zip(even[::2], even[1::2], strict=True):
        length = math.sqrt(-2.0 * math.log(radius))
        numbers += (length * math.cos(math.tau * turn), length * math.sin(math.tau * turn))
    return tuple(numbers)


def happens(share: float, seed: int, *about: object) -> bool:
    """Whether an event that happens in this share of all cases happens in this case."""
    return share > 0.0 and uniforms(seed, *about)[0] < share
