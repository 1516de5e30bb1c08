"""Parts of the gateway that live accounts and test accounts do not share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from skyway.ids import is_live_account

PartT = TypeVar("PartT")
MadeT = TypeVar("MadeT")


@dataclass(frozen=True, slots=True)
class ByMode(Generic[PartT]):
    """A part that works for live accounts, and the same part over the sandbox."""

    live: PartT
    test: PartT

    def of(self, subject_id: str) -> PartT:
        """The part that works for this subject."""
        return self.live if is_live_account(subject_id) else self.test

    def each(self, make: Callable[[PartT], MadeT]) -> "ByMode[MadeT]":
        """What is made of the part of each mode."""
        return ByMode(make(self.live), make(self.test))
