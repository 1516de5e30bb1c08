"""The HTTP side of every cloud service: what all services answer in the same way.

The page /docs is Swagger UI from a package on this machine, so that no other host is asked.
"""

import asyncio
import html
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from importlib.metadata import version
from importlib.resources import as_file, files
from typing import Annotated, Final

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field
from starlette.middleware import Middleware

from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound, ServiceUnavailable
from skyway.runtime.http.openapi_document import Document, complete_document
from skyway.runtime.http.problems import install_problems
from skyway.runtime.http.request_boundary import Admission, RequestBoundary, admit_all
from skyway.runtime.http.service_router import (
    ServiceRouter,
    internal_body,
    read_json,
    takes_bytes,
)

__all__ = ["Health", "Readiness", "create_app", "internal_body", "read_json", "takes_bytes"]

#: Seconds for the check of one part; a part that works answers sooner.
_READINESS_S: Final = 5.0

#: Requests are answered while these parts are away: messages for them wait in the outbox.
_NOT_NEEDED_FOR_ANSWERS: Final = frozenset({"mqtt"})

Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[None]]
#: Checks by name whether each part that a service needs is there.
Readiness = Callable[[], Awaitable[dict[str, bool]]]

#: Turns the OpenAPI document of a service into the document that it shows.
Publish = Callable[[Document], Document]

_ASSETS: Final = {
    "swagger-ui-bundle.js": "text/javascript",
    "swagger-ui.css": "text/css",
    "favicon.png": "image/png",
}

#: Browsers refuse what other hosts send, and every script inside a page.
_ONLY_OURS: Final = "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'"

_PAGE: Final = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<link rel="stylesheet" href="/docs/assets/swagger-ui.css">
<link rel="icon" href="/docs/assets/favicon.png">
</head>
<body>
<div id="swagger-ui"></div>
<script src="/docs/assets/swagger-ui-bundle.js"></script>
<script src="/docs/start.js"></script>
</body>
</html>
"""
_START: Final = """SwaggerUIBundle({
  url: "/openapi.json", dom_id: "#swagger-ui", deepLinking: true, layout: "BaseLayout",
  presets: [SwaggerUIBundle.presets.apis, SwaggerUIBundle.SwaggerUIStandalonePreset],
});
"""

_docs_page = ServiceRouter(include_in_schema=False)


class Health(JsonModel):
    """The process is alive; `checks` says which of the parts that it needs are there."""

    service: Annotated[str, Field(description="The name of the service.")]
    checks: Annotated[
        dict[str, bool],
        Field(description="Each part that the service needs, and whether it is there."),
    ]


class ServiceApp(FastAPI):
    """FastAPI whose OpenAPI document is complete."""

    models: Sequence[type[BaseModel]] = ()
    publish: Publish | None = None
    _making: asyncio.Task[bytes] | None = None

    def openapi(self) -> Document:
        """The OpenAPI 3.1 document, made once."""
        if self.openapi_schema is None:
            own = complete_document(super().openapi(), self.routes, self.models)
            self.openapi_schema = own if self.publish is None else self.publish(own)
        return self.openapi_schema

    async def document(self) -> bytes:
        """The OpenAPI document as JSON, made once, in a thread: it takes half a second."""
        if self._making is None:
            self._making = asyncio.create_task(asyncio.to_thread(self._encoded))
        return await asyncio.shield(self._making)

    def _encoded(self) -> bytes:
        return json.dumps(self.openapi(), ensure_ascii=False, separators=(",", ":")).encode()


def create_app(
    *,
    service: str,
    title: str,
    description: str,
    routers: Sequence[ServiceRouter],
    lifespan: Lifespan,
    readiness: Readiness,
    entrance: Admission = admit_all,
    middleware: Sequence[Middleware] = (),
    models: Sequence[type[BaseModel]] = (),
    webhooks: APIRouter | None = None,
    publish: Publish | None = None,
) -> FastAPI:
    """An app with these routers and with the routes of every service.

    Nothing is opened before the lifespan begins. `entrance` looks at each request before its body
    is read. `middleware` runs inside the request boundary, so each request has its trace.
    For the OpenAPI document: `models` are the models to which routes refer, `webhooks` are the
    calls that the service makes, `publish` changes the document before it is shown.
    """
    boundary = Middleware(RequestBoundary, entrance=entrance)
    app = ServiceApp(
        title=title,
        description=description,
        version=version("skyway"),
        license_info={"name": "MIT", "url": "https://opensource.org/license/mit"},
        lifespan=lifespan,
        openapi_url=None,  # a route of our own: FastAPI would encode the document each time
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        separate_input_output_schemas=False,
        middleware=[boundary, *middleware],
        webhooks=webhooks,
    )
    app.models, app.publish = models, publish
    install_problems(app)
    for router in (*routers, _health_routes(service, readiness), _docs_page):
        app.routes.extend(router.routes)
    return app


def _health_routes(service: str, readiness: Readiness) -> ServiceRouter:
    router = ServiceRouter(tags=("service",))

    @router.get("/healthz")
    async def get_health() -> Health:
        """Whether the process is alive."""
        return Health(service=service, checks={})

    @router.get("/readyz")
    async def get_readiness() -> Health:
        """Whether requests are answered; a 503 names the missing parts.

        The broker is named in `checks` only: no request needs it.
        """
        try:
            checks = await asyncio.wait_for(readiness(), _READINESS_S)
        except TimeoutError as error:
            detail = f"its parts did not answer within {_READINESS_S:.0f} s"
            raise ServiceUnavailable(service, detail) from error
        missing = {name for name, is_there in checks.items() if not is_there}
        if missing - _NOT_NEEDED_FOR_ANSWERS:
            raise ServiceUnavailable(service, f"missing: {', '.join(sorted(missing))}")
        return Health(service=service, checks=checks)

    return router


@asynccontextmanager
async def nothing_to_open(_app: FastAPI) -> AsyncIterator[None]:
    """The lifespan of an app that only documents itself."""
    yield


async def nothing_to_wait_for() -> dict[str, bool]:
    """The readiness of an app that needs nothing."""
    return {}


@_docs_page.get("/docs")
async def show_docs(request: Request) -> Response:
    """The page on which the API can be read and tried."""
    page = _PAGE.format(title=html.escape(request.app.title))
    return HTMLResponse(page, headers={"Content-Security-Policy": _ONLY_OURS})


@_docs_page.get("/docs/start.js")
async def show_docs_script() -> Response:
    """The assets that draw the page."""
    return Response(_START, media_type="text/javascript")


@_docs_page.get("/openapi.json")
async def show_document(request: Request) -> Response:
    """The OpenAPI document."""
    return Response(await request.app.document(), media_type="application/json")


@_docs_page.get("/docs/assets/{name}")
def show_docs_asset(name: str) -> Response:
    """One of the files that the page needs."""
    if name not in _ASSETS:
        raise NotFound("asset", name)
    with as_file(files("fastapi_offline") / "static" / name) as path:
        content = path.read_bytes()
    return Response(
        content, media_type=_ASSETS[name], headers={"Cache-Control": "public, max-age=86400"}
    )
