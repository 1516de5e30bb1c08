"""When a search has to end: by time or by labels. The only file of the planner with a clock.

A `Stop` receives the number of labels (states or routes looked at) that a search has made. It
answers whether the search must end. Only time limits are not repeatable; `LabelLimit` is.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

Stop = Callable[[int], bool]

#: More labels than fit into any memory.
_VERY_MANY = 1 << 40


class OutOfTime(Exception):
    """Ends the preparation of a search."""


def never(_labels: int) -> bool:
    """Let the search run to its own end."""
    return False


class TimeLimit:
    """Ends a search this many seconds of wall time after the limit was made."""

    def __init__(self, limit_s: float) -> None:
        self._deadline_s = time.monotonic() + limit_s

    def __call__(self, _labels: int) -> bool:
        """Whether the time is over."""
        return time.monotonic() >= self._deadline_s


@dataclass(frozen=True, slots=True)
class LabelLimit:
    """Ends a search once it has made this many labels."""

    limit: int

    def __call__(self, labels: int) -> bool:
        """Whether the labels are used up."""
        return labels >= self.limit


def first_of(*stops: Stop) -> Stop:
    """Ends a search as soon as one of these does."""
    return lambda labels: any(stop(labels) for stop in stops)


@dataclass(slots=True)
class Effort:
    """The labels that one search has made so far, and whether it must end."""

    stop: Stop
    labels: int = 0
    most_labels: int | None = None
    #: Whole routes simulated, by the strategies that simulate routes.
    compositions: int = 0
    #: Whether the search had to end when labels were last counted.
    is_over: bool = False

    @property
    def room(self) -> int:
        """How many labels may still be made; very many where there is no limit."""
        most = _VERY_MANY if self.most_labels is None else self.most_labels
        return max(0, most - self.labels)

    def is_spent(self) -> bool:
        """Count one more label; True when the search has to end."""
        return self.has_made(1)

    def has_made(self, labels: int) -> bool:
        """Count these labels; True when the search has to end."""
        self.labels += labels
        self.is_over = self.stop(self.labels) or self.room == 0
        return self.is_over


def stopwatch() -> Callable[[], float]:
    """Seconds of wall time since this call, whenever the answer is called."""
    start_s = time.perf_counter()
    return lambda: time.perf_counter() - start_s


def processor_stopwatch() -> Callable[[], float]:
    """Seconds of this process's processor time since this call, whenever the answer is called."""
    start_s = time.process_time()
    return lambda: time.process_time() - start_s
