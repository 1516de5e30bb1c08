"""Service apps that tests build once a process: building an app takes longer than most tests.

An app keeps the parts of its service in its routes. A shared app keeps stand-ins instead. Each
request says whose parts it is for, and a stand-in forwards to the part with its name.
"""

import inspect
from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from functools import cache
from typing import Any, get_type_hints

from fastapi import FastAPI
from starlette.types import ASGIApp, Receive, Scope, Send

from skyway.runtime.http.app import nothing_to_open, nothing_to_wait_for


class _Served:
    """The parts of one test. A part that is made when it is read is made once, as in an app."""

    def __init__(self, parts: object) -> None:
        self._parts = parts
        self._read: dict[str, Any] = {}

    def part(self, name: str) -> Any:  # parts have nothing in common
        if name not in self._read:
            self._read[name] = getattr(self._parts, name)
        return self._read[name]


_served: ContextVar[_Served] = ContextVar("served")


def _part(name: str) -> Any:
    return _served.get().part(name)


class StandIn:
    """Forwards everything that an app does with a part to the part that a function finds."""

    def __init__(self, find: Callable[[], Any]) -> None:
        self._find = find

    def __getattr__(self, name: str) -> Any:
        return getattr(self._find(), name)

    def __call__(self, *args: Any, **named: Any) -> Any:
        return self._find()(*args, **named)

    def __getitem__(self, key: str) -> "StandIn":
        return StandIn(lambda: self._find()[key])


class _StandIns:
    """A stand-in for each part of a service. FastAPI reads the signatures of the gates."""

    def __init__(self, parts: type) -> None:
        self._hints = get_type_hints(parts)

    def __getattr__(self, name: str) -> Any:
        def find() -> Any:
            return _part(name)

        check = inspect.getattr_static(self._hints.get(name), "__call__", None)
        return _gate(check, find) if inspect.iscoroutinefunction(check) else StandIn(find)


def _gate(check: Callable[..., Any], find: Callable[[], Any]) -> Callable[..., Awaitable[Any]]:
    async def gate(**given: Any) -> Any:
        return await find()(**given)

    signature = inspect.signature(check)
    _, *shown = signature.parameters.values()
    gate.__signature__ = signature.replace(parameters=shown)  # type: ignore[attr-defined]
    return gate


@cache
def built_app(make: Callable[..., FastAPI]) -> FastAPI:
    """The app of this process that `make` makes of stand-ins for its parts."""
    parts = _StandIns(get_type_hints(make)["parts"])
    return make(parts, lifespan=nothing_to_open, readiness=nothing_to_wait_for)


def shared_app(make: Callable[..., FastAPI], parts: object) -> ASGIApp:
    """The app that `make` makes, for requests to these parts."""
    app, served = built_app(make), _Served(parts)

    async def serve(scope: Scope, receive: Receive, send: Send) -> None:
        token = _served.set(served)
        try:
            await app(scope, receive, send)
        finally:
            _served.reset(token)

    return serve
