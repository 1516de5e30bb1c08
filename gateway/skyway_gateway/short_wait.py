"""Asks a service, and goes on without an answer that does not come soon."""

import asyncio
from collections.abc import Coroutine
from typing import Any, Final, TypeVar

from skyway.runtime.errors import ServiceUnavailable

#: How long a request waits for a service before it goes on without, wall seconds. The socket of a
#: process that restarts stays open, so a call would wait there until the process is back.
_ANSWERS_WITHIN_S: Final = 1.0

AnswerT = TypeVar("AnswerT")


class ShortWait:
    """Asks one service; while a question is unanswered for longer, others do not wait at all."""

    def __init__(self) -> None:
        self._asking = set[asyncio.Task[Any]]()  # tasks of any answer
        self._is_silent = False

    async def answer_of(self, question: Coroutine[Any, Any, AnswerT]) -> AnswerT | None:
        """The answer; None when the service is away or does not answer in time."""
        if self._is_silent and self._asking:
            question.close()
            return None
        asking = asyncio.create_task(question)
        self._asking.add(asking)
        asking.add_done_callback(self._ended)
        done, _ = await asyncio.wait({asking}, timeout=_ANSWERS_WITHIN_S)
        if not done:
            self._is_silent = True
            return None
        try:
            return asking.result()
        except ServiceUnavailable:
            return None

    def _ended(self, asking: asyncio.Task[Any]) -> None:
        self._asking.discard(asking)
        self._is_silent = False
        if not asking.cancelled():
            asking.exception()  # it was raised already, or nobody waits for it any more
