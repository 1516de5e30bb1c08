"""Values under topics or filters, found level by level."""

from collections.abc import Iterator
from typing import Generic, TypeVar

V = TypeVar("V")


class _Node(Generic[V]):
    __slots__ = ("below", "value")

    def __init__(self) -> None:
        self.below: dict[str, _Node[V]] = {}
        self.value: V | None = None


class TopicTree(Generic[V]):
    """One value for each path; a path is a topic, or a filter without `#`.

    A look-up visits the levels of a topic, not all paths: so its cost does not grow with the number
    of clients or messages that it does not find.
    """

    def __init__(self) -> None:
        self._root: _Node[V] = _Node()

    def get(self, path: str) -> V | None:
        """The value at exactly this path."""
        node: _Node[V] | None = self._root
        for level in path.split("/"):
            if node is None:
                return None
            node = node.below.get(level)
        return None if node is None else node.value

    def put(self, path: str, value: V) -> None:
        """Replace the value at this path."""
        node = self._root
        for level in path.split("/"):
            node = node.below.setdefault(level, _Node())
        node.value = value

    def pop(self, path: str) -> None:
        """Remove the value at this path, and the levels that lead nowhere now."""
        levels = path.split("/")
        node, way = self._root, []
        for level in levels:
            below = node.below.get(level)
            if below is None:
                return
            way.append((node, level))
            node = below
        node.value = None
        for parent, level in reversed(way):
            child = parent.below[level]
            if child.value is not None or child.below:
                return
            del parent.below[level]

    def matching(self, topic: str) -> list[V]:
        """The values of all filters that match a topic."""
        nodes = [self._root]
        for level in topic.split("/"):
            nodes = [
                found
                for node in nodes
                for found in (node.below.get(level), node.below.get("+"))
                if found is not None
            ]
        return [node.value for node in nodes if node.value is not None]

    def under(self, topic_filter: str) -> Iterator[tuple[str, V]]:
        """Topic and value of all topics that a filter without `#` matches."""
        found: list[tuple[str, _Node[V]]] = [("", self._root)]
        for level in topic_filter.split("/"):
            found = [
                (f"{head}{name}/", below)
                for head, node in found
                for name, below in (
                    node.below.items()
                    if level == "+"
                    else [(level, node.below[level])]
                    if level in node.below
                    else ()
                )
            ]
        for head, node in found:
            if node.value is not None:
                yield head[:-1], node.value
