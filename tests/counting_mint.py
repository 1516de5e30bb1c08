"""Identifiers that are the same in every run."""

from collections import Counter


class CountingMint:
    """A mint of identifiers: the prefix, and a count of its own."""

    def __init__(self) -> None:
        self._minted: Counter[str] = Counter()

    def __call__(self, prefix: str) -> str:
        """The next identifier with this prefix."""
        self._minted[prefix] += 1
        return f"{prefix}_{self._minted[prefix]:06d}"
