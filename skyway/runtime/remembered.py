"""Answers that are believed for a moment, so that a busy caller need not wait for each."""

import asyncio
from collections.abc import Awaitable, Callable, Hashable
from datetime import datetime, timedelta
from typing import Generic, TypeVar

from skyway.runtime.clock import FleetClock

QuestionT = TypeVar("QuestionT", bound=Hashable)
AnswerT = TypeVar("AnswerT")


class Remembered(Generic[QuestionT, AnswerT]):
    """What was answered to questions; at most `most` of them, each for `kept` of wall time.

    One that is asked for again in the second half of its time is renewed meanwhile: who asks
    often never waits. The same question is not asked twice at once.
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
        self._known: dict[QuestionT, tuple[datetime, AnswerT]] = {}
        self._asking: dict[QuestionT, asyncio.Task[AnswerT]] = {}

    def answer(self, question: QuestionT) -> AnswerT | None:
        """What was answered of late; None when it must be asked."""
        asked_at, answer = self._known.get(question, (None, None))
        if asked_at is None:
            return None
        age = self._clock.wall_now() - asked_at
        if not timedelta() <= age < self._kept:  # the machine's clock may be set back
            return None
        if age >= self._kept / 2:
            self._under_way(question)
        return answer

    async def ask(self, question: QuestionT) -> AnswerT:
        """The answer of now, which is remembered unless it is None; errors are those of `ask`."""
        # Others may wait for the same answer: who is cancelled leaves it to them.
        return await asyncio.shield(self._under_way(question))

    def forget(self) -> None:
        """Remember nothing of what was asked until now, answered or not."""
        self._known = {}
        self._asking = {}

    def _under_way(self, question: QuestionT) -> asyncio.Task[AnswerT]:
        asking = self._asking
        if question not in asking:
            asking[question] = asyncio.create_task(self._renew(question, self._known))
            asking[question].add_done_callback(lambda done: _ended(asking, question, done))
        return asking[question]

    async def _renew(
        self, question: QuestionT, known: dict[QuestionT, tuple[datetime, AnswerT]]
    ) -> AnswerT:
        """Ask, and note the answer where nobody looks any more if all was forgotten meanwhile."""
        asked_at = self._clock.wall_now()
        answer = await self._ask(question)
        if answer is None:
            known.pop(question, None)
        else:
            if len(known) >= self._most and question not in known:
                known.clear()
            known[question] = (asked_at, answer)
        return answer


def _ended(
    asking: dict[QuestionT, asyncio.Task[AnswerT]],
    question: QuestionT,
    done: asyncio.Task[AnswerT],
) -> None:
    """A renewal that failed harms nobody: the answer is asked for when its time is over."""
    del asking[question]
    if not done.cancelled():
        done.exception()
