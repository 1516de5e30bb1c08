"""Seeds and reproducible chance."""

from random import Random


def chance(seed: int | str) -> Random:
    """Reproducible chance; the same for the same seed, on every machine."""
    return Random(seed)  # noqa: S311 - reproducible chance is the point, nothing is secret


def seed_of(*parts: object) -> int:
    """A seed made of these parts: the same for the same parts."""
    return chance("/".join(map(str, parts))).getrandbits(48)
