"""The /docs page: Swagger UI from a package on this machine, so that no other host is asked."""

from importlib.resources import as_file, files
from typing import Final

from fastapi import Request, Response
from fastapi.openapi.docs import get_swagger_ui_html

from skyway.runtime.errors import NotFound
from skyway.runtime.http.service_router import ServiceRouter

_ASSETS: Final = {
    "swagger-ui-bundle.js": "text/javascript",
    "swagger-ui.css": "text/css",
    "favicon.png": "image/png",
}
#: The browser itself refuses what is not ours; the page's own script and styles are inline.
_ONLY_OURS: Final = "default-src 'self' 'unsafe-inline'; img-src 'self' data:"

router = ServiceRouter(include_in_schema=False)


@router.get("/docs")
async def show_docs(request: Request) -> Response:
    """The page on which the API can be read and tried."""
    page = get_swagger_ui_html(
        openapi_url="/openapi.json",
        title=request.app.title,
        swagger_js_url="/docs/assets/swagger-ui-bundle.js",
        swagger_css_url="/docs/assets/swagger-ui.css",
        swagger_favicon_url="/docs/assets/favicon.png",
    )
    page.headers["Content-Security-Policy"] = _ONLY_OURS
    return page


@router.get("/docs/assets/{name}")
def show_docs_asset(name: str) -> Response:
    """One of the files that the page needs."""
    if name not in _ASSETS:
        raise NotFound("asset", name)
    with as_file(files("fastapi_offline") / "static" / name) as path:
        content = path.read_bytes()
    return Response(
        content, media_type=_ASSETS[name], headers={"Cache-Control": "public, max-age=86400"}
    )
