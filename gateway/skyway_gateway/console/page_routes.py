"""The console's page and files over HTTP. They hold no secret; the calls of the page need a key."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Final

from fastapi import Request, Response
from fastapi.responses import FileResponse

from skyway.runtime.errors import NotFound
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.console.console_files import (
    BaseMap,
    ConsoleFile,
    console_files,
    import_map_hash,
)

CONSOLE_PATH: Final = "/console"
BASE_MAP_PATH: Final = "/console-map"
_PAGE: Final = "index.html"

#: Asked for again each time; an unchanged file is answered with 304 and no content.
_CACHE: Final = "no-cache"


def console_routes(*, base_map: BaseMap) -> ServiceRouter:
    """GET /console, its files below /console/, and the operator's base map below /console-map/."""
    router = ServiceRouter(include_in_schema=False)

    @router.get(CONSOLE_PATH)
    def show_console(request: Request) -> Response:
        """The page."""
        return _answer(request, console_files()[_PAGE], _page_headers())

    @router.get(f"{CONSOLE_PATH}/bundled-network.json")
    def show_bundled_network() -> Response:
        """The network that comes with Skyway, for an operator who publishes it as a beginning."""
        headers = {"Cache-Control": _CACHE}
        return Response(_bundled_network(), media_type="application/json", headers=headers)

    @router.get(f"{CONSOLE_PATH}/{{path:path}}")
    def show_file(request: Request, path: str) -> Response:
        """A file that the page needs."""
        file = console_files().get(path)
        if file is None or path == _PAGE:
            raise NotFound("console file", path)
        return _answer(request, file, {})

    @router.get(f"{BASE_MAP_PATH}/{{path:path}}")
    def show_base_map(path: str) -> Response:
        """A file of the operator's base map; a part of it for `Range`, as PMTiles need.

        204 without such a map.
        """
        if base_map.folder is None:
            return Response(status_code=204)
        return FileResponse(base_map.file_at(path), headers={"Cache-Control": _CACHE})

    return router


@cache
def _bundled_network() -> bytes:
    # Imported here: networks need NumPy, which a gateway that serves requests does without.
    from skyway.network.bundled import texas_corridor
    from skyway.network.geojson import write_network

    return json.dumps(write_network(texas_corridor())).encode()


def _page_headers() -> Mapping[str, str]:
    """No other host, no script in the page but its import map, and no frame around it."""
    return {
        "Content-Security-Policy": f"default-src 'none'; script-src 'self' '{import_map_hash()}'; "
        "style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; worker-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        "Referrer-Policy": "no-referrer",
        "X-Robots-Tag": "noindex, nofollow",
    }


def _answer(request: Request, file: ConsoleFile, headers: Mapping[str, str]) -> Response:
    sent = {"ETag": file.etag, "Cache-Control": _CACHE, "Vary": "Accept-Encoding", **headers}
    if request.headers.get("if-none-match") == file.etag:
        return Response(status_code=304, headers=sent)
    if "gzip" in request.headers.get("accept-encoding", ""):
        sent["Content-Encoding"] = "gzip"
        return Response(file.compressed, media_type=file.media_type, headers=sent)
    return Response(file.content, media_type=file.media_type, headers=sent)
