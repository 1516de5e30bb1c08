"""The sync and the async client: each sends calls, repeats what may be repeated, and iterates."""

import asyncio
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, ExitStack
from types import TracebackType
from typing import Final, Self, TypeVar

import httpx
import stamina
from httpx_sse import EventSource

from skyway_client.call import Call
from skyway_client.delivery_events import DeliveryEvent
from skyway_client.events import REOPEN_AFTER_S, SILENCE_S, event_in, stream_of
from skyway_client.pages import Page
from skyway_client.retries import retry_rule

AnswerT = TypeVar("AnswerT")
ItemT = TypeVar("ItemT")

_TIMEOUT_S: Final = 30.0
_MOST_ATTEMPTS: Final = 5


class Skyway:
    """Sends calls to one gateway with one key.

    Parameters
    ----------
    url
        Of the gateway: `http://127.0.0.1:8000`.
    key
        `sk_...`.
    timeout_s
        How long an answer may take, seconds.
    most_attempts
        How often a call is sent at most, from 1.
    """

    def __init__(
        self,
        url: str,
        key: str,
        *,
        timeout_s: float = _TIMEOUT_S,
        most_attempts: int = _MOST_ATTEMPTS,
    ) -> None:
        self._http = httpx.Client(base_url=url, headers=_headers(key), timeout=timeout_s)
        self._retries = stamina.RetryingCaller(attempts=most_attempts, timeout=None)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def send(self, call: Call[AnswerT]) -> AnswerT:
        """The answer to a call; every repetition has the same idempotency key.

        Raises
        ------
        SkywayError
            The server refused the call: the subclass in `skyway_client.problems` says why.
        httpx.TransportError
            No answer came.
        """
        keyed = call.with_idempotency_key()
        return self._retries.on(retry_rule(keyed))(self._send_once, keyed)

    def _send_once(self, call: Call[AnswerT]) -> AnswerT:
        return call.answer_of(self._http.send(call.request_of(self._http)))

    def each(self, call: Call[Page[ItemT]]) -> Iterator[ItemT]:
        """The items of all pages of a list, which are asked for when they are needed."""
        page = self.send(call)
        yield from page.items
        while page.next_cursor:
            page = self.send(call.after(page.next_cursor))
            yield from page.items

    def events(self, delivery_id: str, *, after: int = 0) -> Iterator[DeliveryEvent]:
        """The events of a delivery after this sequence, until its last one.

        A stream that breaks is opened again, and continues after the last event that came.
        """
        while True:
            try:
                with ExitStack() as stack:
                    call = stream_of(delivery_id, after=after)
                    stream = self._retries.on(retry_rule(call))(self._open, call, stack)
                    if stream is None:
                        return
                    for frame in EventSource(stream).iter_sse():
                        after = int(frame.id)
                        event = event_in(frame)
                        if event is not None:
                            yield event
            except httpx.TransportError:
                time.sleep(REOPEN_AFTER_S)

    def _open(self, call: Call[bool], stack: ExitStack) -> httpx.Response | None:
        """The open stream, which the stack closes; None if no more events come."""
        request = call.request_of(self._http)
        request.extensions["timeout"]["read"] = SILENCE_S
        response = self._http.send(request, stream=True)
        stack.callback(response.close)
        if response.is_error:
            response.read()
        return response if call.answer_of(response) else None


class AsyncSkyway:
    """The same as `Skyway` for asyncio."""

    def __init__(
        self,
        url: str,
        key: str,
        *,
        timeout_s: float = _TIMEOUT_S,
        most_attempts: int = _MOST_ATTEMPTS,
    ) -> None:
        self._http = httpx.AsyncClient(base_url=url, headers=_headers(key), timeout=timeout_s)
        self._retries = stamina.AsyncRetryingCaller(attempts=most_attempts, timeout=None)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def send(self, call: Call[AnswerT]) -> AnswerT:
        """See `Skyway.send`."""
        keyed = call.with_idempotency_key()
        return await self._retries.on(retry_rule(keyed))(self._send_once, keyed)

    async def _send_once(self, call: Call[AnswerT]) -> AnswerT:
        return call.answer_of(await self._http.send(call.request_of(self._http)))

    async def each(self, call: Call[Page[ItemT]]) -> AsyncIterator[ItemT]:
        """See `Skyway.each`."""
        page = await self.send(call)
        for item in page.items:
            yield item
        while page.next_cursor:
            page = await self.send(call.after(page.next_cursor))
            for item in page.items:
                yield item

    async def events(self, delivery_id: str, *, after: int = 0) -> AsyncIterator[DeliveryEvent]:
        """See `Skyway.events`."""
        while True:
            try:
                async with AsyncExitStack() as stack:
                    call = stream_of(delivery_id, after=after)
                    stream = await self._retries.on(retry_rule(call))(self._open, call, stack)
                    if stream is None:
                        return
                    async for frame in EventSource(stream).aiter_sse():
                        after = int(frame.id)
                        event = event_in(frame)
                        if event is not None:
                            yield event
            except httpx.TransportError:
                await asyncio.sleep(REOPEN_AFTER_S)

    async def _open(self, call: Call[bool], stack: AsyncExitStack) -> httpx.Response | None:
        """The open stream, which the stack closes; None if no more events come."""
        request = call.request_of(self._http)
        request.extensions["timeout"]["read"] = SILENCE_S
        response = await self._http.send(request, stream=True)
        stack.push_async_callback(response.aclose)
        if response.is_error:
            await response.aread()
        return response if call.answer_of(response) else None


def _headers(key: str) -> dict[str, str]:
    return {"authorization": f"Bearer {key}", "user-agent": "skyway-client-python"}
