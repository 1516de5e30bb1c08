"""Tests share apps, so an app must keep nothing of a test; see `tests/shared_app.py`."""

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from types import FunctionType
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute
from skyway_composition.app import composition_app
from skyway_gateway.app import gateway_app
from skyway_provider_registry.app import registry_app

from tests.shared_app import StandIn, built_app

_UNCHANGEABLE = (StandIn, FunctionType, type, str, int, float, tuple, frozenset, type(None))


@pytest.mark.parametrize("make", [gateway_app, composition_app, registry_app])
def test_a_shared_app_keeps_only_what_cannot_change(make: Callable[..., FastAPI]) -> None:
    app = built_app(make)
    routes = [route.endpoint for route in app.routes if isinstance(route, APIRoute)]
    middleware = [given for each in app.user_middleware for given in each.kwargs.values()]

    kept = [value for each in (*routes, *middleware) for value in _kept_by(each)]

    assert any(isinstance(value, StandIn) for value in kept)
    changeable = [value for value in kept if not isinstance(value, _UNCHANGEABLE)]
    assert [value for value in changeable if not _is_frozen(value)] == []


def _kept_by(value: Any) -> Iterator[Any]:
    """A value and all that it keeps: what a function encloses, the fields of a dataclass."""
    yield value
    kept: list[Any] = []
    if isinstance(value, FunctionType):
        kept = [cell.cell_contents for cell in value.__closure__ or ()]
    elif _is_frozen(value):
        kept = [getattr(value, field.name) for field in fields(value)]
    for each in kept:
        yield from _kept_by(each)


def _is_frozen(value: Any) -> bool:
    return is_dataclass(value) and bool(vars(type(value))["__dataclass_params__"].frozen)
