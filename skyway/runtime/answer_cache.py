"""A cache of answers to questions that many callers ask again and again."""

import asyncio
from collections.abc import Awaitable, Callable, Hashable
from datetime import datetime, timedelta
from typing import Generic, TypeVar

from skyway.runtime.clock import FleetClock

QuestionT = TypeVar("QuestionT", bound=Hashable)
AnswerT = TypeVar("AnswerT")


class AnswerCache(Generic[QuestionT, AnswerT]):
    """The answers to at most `most` questions, each for `kept` of wall time.

    A question that comes in the second half of that time renews its answer in the background, so
    frequent callers never wait. Callers who ask the same question concurrently share one answer.
    """

    def __init__(
        self,
        ask: Callable[[QuestionT], Awaitable[AnswerT]],
        *,
        clock: FleetClock,
        kept: timedelta,
        most: int,
    ) -> None:
        self._ask = ask
        self._clock = clock
        self._kept = kept
        self._most = most
        self._cached: dict[QuestionT, tuple[datetime, AnswerT]] = {}
        self._asking: dict[QuestionT, asyncio.Task[AnswerT]] = {}

    def cached(self, question: QuestionT) -> AnswerT | None:
        """The cached answer; None when there is none."""
        asked_at, answer = self._cached.get(question, (None, None))
        if asked_at is None:
            return None
        age = self._clock.wall_now() - asked_at
        if not timedelta() <= age < self._kept:  # the machine's clock may be set back
            return None
        if age >= self._kept / 2:
            self._start_asking(question)
        return answer

    async def ask(self, question: QuestionT) -> AnswerT:
        """A new answer, which is cached unless it is None; errors are those of `ask`."""
        # Others may wait for the same answer, so a cancelled caller must not cancel the task.
        return await asyncio.shield(self._start_asking(question))

    def clear(self) -> None:
        """Forget all answers, and those to questions that are being asked now."""
        self._cached = {}
        self._asking = {}

    def _start_asking(self, question: QuestionT) -> asyncio.Task[AnswerT]:
        asking = self._asking
        if question not in asking:
            asking[question] = asyncio.create_task(self._renew(question, self._cached))
            asking[question].add_done_callback(lambda done: _ended(asking, question, done))
        return asking[question]

    async def _renew(
        self, question: QuestionT, cached: dict[QuestionT, tuple[datetime, AnswerT]]
    ) -> AnswerT:
        """Ask, and keep the answer in the dictionary of that time: `clear` may replace it."""
        asked_at = self._clock.wall_now()
        answer = await self._ask(question)
        if answer is None:
            cached.pop(question, None)
        else:
            if len(cached) >= self._most and question not in cached:
                cached.clear()
            cached[question] = (asked_at, answer)
        return answer


def _ended(
    asking: dict[QuestionT, asyncio.Task[AnswerT]],
    question: QuestionT,
    done: asyncio.Task[AnswerT],
) -> None:
    """Ignore an error of a renewal: the question is asked again when the answer has expired."""
    del asking[question]
    if not done.cancelled():
        done.exception()
