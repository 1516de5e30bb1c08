"""A page of the console or the tracking page in a browser, with answers that a test chooses.

No server runs: the browser gets the pages' own files, and the test says what the gateway answers
and what its streams send.
"""

import asyncio
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import httpx
from fastapi import FastAPI
from playwright.sync_api import Browser, BrowserContext, Page, Request, Route

from tests.end_to_end.browser import free_context, rest

_PACKAGE: Final = Path(__file__).parents[3] / "gateway/skyway_console"
#: The console's stream of the live picture.
LIVE: Final = "/v1/live"

_HOST: Final = "http://skyway.test"
_TYPES: Final = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".css": "text/css",
}

#: An answer of the gateway: JSON, or what makes it from the address that is asked.
Answer = Any | Callable[[str], Any]

_STREAMS: Final = """
window.streams = [];
window.EventSource = class extends EventTarget {
  static CONNECTING = 0;
  static OPEN = 1;
  static CLOSED = 2;
  constructor(url) {
    super();
    Object.assign(this, {url, readyState: 0});
    window.streams.push(this);
  }
  close() { this.readyState = 2; }
  open() {
    this.readyState = 1;
    this.dispatchEvent(new Event("open"));
  }
  send(type, value) {
    if (this.readyState === 2) return;
    this.readyState = 1;
    this.dispatchEvent(new MessageEvent(type, {data: JSON.stringify(value)}));
  }
  fail(readyState) {
    this.readyState = readyState;
    this.dispatchEvent(new Event("error"));
  }
};
let visibility = "visible";
Object.defineProperty(document, "visibilityState", {get: () => visibility});
window.setVisibility = (next) => {
  visibility = next;
  document.dispatchEvent(new Event("visibilitychange"));
};
"""

#: Lets maps compute everything and draw nothing: without a graphics card, drawing takes more than
#: half of the processor time of these tests. Framebuffers are complete, and shaders have no inputs.
_UNDRAWN: Final = """
const answers = {
  getError: 0, getExtension: null, isContextLost: false, checkFramebufferStatus: 0x8CD5,
  getShaderParameter: true, getAttribLocation: -1, getSupportedExtensions: [],
};
const sizes = {0x0D3A: [8192, 8192], 0x1F02: "WebGL 2.0", 0x8B8C: "WebGL GLSL ES 3.00"};
const calls = {
  getParameter: (name) => sizes[name] ?? 8192,
  getProgramParameter: (_, name) => name === 0x8B82 || 0,
  getContextAttributes: () => ({antialias: false, stencil: true, depth: true}),
};
const drawn = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
  if (!kind.startsWith("webgl")) return drawn.call(this, kind, ...options);
  return this.undrawn ??= new Proxy({canvas: this}, {
    get: (target, name) => target[name] ??= name === name.toUpperCase()
      ? WebGL2RenderingContext[name]
      : calls[name] ?? (() => name in answers ? answers[name] : {}),
    set: () => true,
  });
};
"""


class StagedPage:
    """A page whose gateway is `answers`: by path, without the query."""

    def __init__(
        self,
        browser: Browser,
        answers: dict[str, Answer],
        *,
        context: BrowserContext | None = None,
        draws_maps: bool = False,
    ) -> None:
        self.answers: dict[str, Answer] = {
            "/v1/clock": {"now": "2026-03-01T12:00:00Z", "rate": 1.0},
            "/v1/sessions/current": {"subject_id": "ops", "role": "operator"},
            "/v1/networks": {"items": [], "next_cursor": None},
        } | answers
        self.is_silent = False
        self.asked: list[str] = []
        self.errors: list[str] = []
        self._has_own_clock = False
        opened = context or free_context(browser, timezone_id="UTC")
        self.page: Page = opened.new_page()
        self.page.add_init_script(_STREAMS)
        if not draws_maps:
            self.page.add_init_script(_UNDRAWN)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.route("**/*", self._answer)

    def ask(self, app: FastAPI, addresses: str) -> list[int]:
        """Let an app answer these addresses; the list gets the statuses of its answers."""
        statuses: list[int] = []

        async def asked(request: Request) -> httpx.Response:
            transport = httpx.ASGITransport(app)
            async with httpx.AsyncClient(transport=transport, base_url=_HOST) as http:
                return await http.request(request.method, request.url, headers=request.headers)

        def answer(route: Route) -> None:
            # The thread of the browser has an event loop that runs.
            with ThreadPoolExecutor(1) as aside:
                given = aside.submit(asyncio.run, asked(route.request)).result()
            statuses.append(given.status_code)
            headers = dict(given.headers)
            route.fulfill(status=given.status_code, headers=headers, body=given.content)

        self.page.route(addresses, answer)
        return statuses

    def open(self, path: str) -> "StagedPage":
        self.page.goto(_HOST + path)
        return self

    def send(self, url: str, kind: str, value: Any) -> None:
        """Send an event by the newest stream of this address."""
        self.page.wait_for_function("url => streams.some((each) => each.url === url)", arg=url)
        self.page.evaluate(
            """([url, kind, value]) =>
              streams.findLast((each) => each.url === url).send(kind, value)""",
            [url, kind, value],
        )

    def fail(self, url: str, *, is_refused: bool) -> None:
        """Break the newest stream of this address; the browser does not try a refused one again."""
        self.page.evaluate(
            "([url, state]) => streams.findLast((each) => each.url === url).fail(state)",
            [url, 2 if is_refused else 0],
        )

    def reconnect(self, url: str) -> None:
        """The browser has connected again, and the stream goes on."""
        self.page.evaluate("url => streams.findLast((each) => each.url === url).open()", url)

    def install_clock(self) -> None:
        """From now on the test can move the page's clock."""
        self._has_own_clock = True
        self.page.clock.install()

    def close(self) -> None:
        """Leave what the next page can use. A clock that a test moves stays in its context."""
        if self._has_own_clock:
            self.page.context.close()
        else:
            rest(self.page.context)

    def sleep(self, seconds: int) -> None:
        """Nobody sees the page for so long."""
        self.page.evaluate("setVisibility('hidden')")
        self.page.clock.fast_forward(1000 * seconds)
        self.page.evaluate("setVisibility('visible')")

    def streams(self, url: str) -> int:
        """How many streams of this address were opened."""
        count: int = self.page.evaluate(
            "url => streams.filter((each) => each.url === url).length", url
        )
        return count

    def _answer(self, route: Route) -> None:
        asked = urlsplit(route.request.url)
        file = _page(asked.path) if route.request.is_navigation_request() else _file(asked.path)
        if file is not None and file.is_file():
            content_type = _TYPES.get(file.suffix, "application/octet-stream")
            route.fulfill(body=file.read_bytes(), content_type=content_type)
            return
        if self.is_silent:
            route.abort()
            return
        self.asked.append(f"{route.request.method} {asked.path}?{asked.query}")
        answer = self.answers.get(asked.path)
        if callable(answer):
            answer = answer(asked.query)
        if answer is None:
            route.fulfill(status=404, body='{"title": "There is no such thing."}')
        else:
            route.fulfill(body=json.dumps(answer), content_type="application/json")


def _page(path: str) -> Path:
    """The page of the console or the tracking page with this address."""
    return _PACKAGE / ("console" if path == "/console" else "tracking") / "index.html"


def _file(path: str) -> Path | None:
    """The file of the console or the tracking page with this address."""
    if path.startswith("/console/"):
        return _PACKAGE / path.removeprefix("/")
    if path.startswith("/track/assets/"):
        return _PACKAGE / "tracking" / path.removeprefix("/track/assets/")
    return None


def delivery(delivery_id: str, *, packages: Any = (), **members: Any) -> dict[str, Any]:
    """A delivery as the gateway shows it."""
    return {
        "delivery_id": delivery_id,
        "customer_id": "river-books",
        "reference": None,
        "state": "IN_PROGRESS",
        "activity": None,
        "request": {"pickup": {"station_id": "a"}, "qos": {}},
        "pickup": {"station_id": "a"},
        "packages": list(packages),
        "missions": [],
        "created_at": "2026-03-01T11:00:00Z",
        **members,
    }
