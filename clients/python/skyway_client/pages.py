"""Lists come in pages."""

from collections.abc import Sequence
from typing import Any, Protocol, TypeVar

ItemT_co = TypeVar("ItemT_co", covariant=True)


class Page(Protocol[ItemT_co]):
    """One page of a list: `next_cursor` asks for the next page, and is null on the last one."""

    @property
    def items(self) -> Sequence[ItemT_co]:
        """The items of the page."""

    @property
    def next_cursor(self) -> Any:
        """Where the next page begins: a text; null or unset at the end."""
