"""Routes are built for who asks for them, and all of them before an app is served."""

import copy
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import httpx
import pytest
from fastapi import FastAPI

from skyway.runtime.http.app import create_app, nothing_to_wait_for
from skyway.runtime.http.late_route import LateRoute
from skyway.runtime.http.service_router import ServiceRouter


def built(app: FastAPI) -> set[str]:
    """The paths of the routes that FastAPI has built."""
    routes = [route for route in app.routes if isinstance(route, LateRoute)]
    return {route.path for route in routes if "dependant" in vars(route)}


@pytest.fixture
def route() -> LateRoute:
    """One that nobody has asked for anything."""
    router = ServiceRouter()

    @router.get("/drones/{drone_id}")
    async def drone(drone_id: int) -> int:
        return drone_id

    [made] = router.routes
    assert isinstance(made, LateRoute)
    return made


async def test_only_the_route_that_is_asked_for_is_built(
    make_app: Callable[..., FastAPI],
) -> None:
    app = make_app()
    before = built(app)
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as client:
        answer = await client.get("/healthz")

    assert answer.status_code == 200
    # Those of the docs page are the same in every app.
    assert built(app) - before == {"/healthz"}
    assert "/readyz" not in built(app)


async def test_all_routes_are_built_before_anything_is_opened_to_serve_them() -> None:
    seen: list[set[str]] = []

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        seen.append(built(app))
        yield

    app = create_app(
        service="loads",
        title="Loads",
        description="",
        routers=[],
        lifespan=lifespan,
        readiness=nothing_to_wait_for,
    )
    async with app.router.lifespan_context(app):
        pass

    assert seen == [{route.path for route in app.routes if isinstance(route, LateRoute)}]
    assert {"/healthz", "/readyz", "/metrics"} <= seen[0]


def test_what_building_makes_is_there_when_it_is_looked_at(route: LateRoute) -> None:
    before = set(vars(route))

    assert [field.name for field in route.dependant.path_params] == ["drone_id"]
    assert "dependant" not in before


def test_what_no_route_has_is_missing_as_ever(route: LateRoute) -> None:
    route.build()

    with pytest.raises(AttributeError, match="propellers"):
        route.propellers  # noqa: B018


def test_a_route_can_be_copied(route: LateRoute) -> None:
    assert copy.copy(route).path_format == "/drones/{drone_id}"
