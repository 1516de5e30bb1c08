"""A browser for stories: Debian's Chromium, driven by Playwright."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Literal
from urllib.parse import urljoin

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize, expect, sync_playwright

#: The headless shell draws without the parts of a whole browser, in a third less processor time.
CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium")

needs_browser = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium-headless-shell and no chromium is installed: see .ci/run"
)

#: Milliseconds: longer than anything that a page waits for.
LONGEST_WAIT_MS = 300_000


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """A browser without windows, while the block lasts."""
    expect.set_options(timeout=LONGEST_WAIT_MS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"]
        )
        try:
            yield browser
        finally:
            browser.close()


#: The address of an empty page that stays between stories. It keeps the process of its site, and
#: with it all compiled scripts: the next page of the site opens in half the processor time.
_RESTING: Final = "/resting"


def log_out(browser: Browser) -> None:
    """Close all pages. The next story logs in anew, and finds the compiled scripts."""
    for context in browser.contexts:
        if context.pages:
            rest(context)


def rest(context: BrowserContext) -> None:
    """Leave an empty page, and close all others."""
    others = list(context.pages)
    # A page that a story has used may still go elsewhere by itself.
    empty = context.new_page()
    empty.route(f"**{_RESTING}", lambda route: route.fulfill(content_type="text/html", body=""))
    empty.goto(urljoin(others[-1].url, _RESTING))
    for page in others:
        page.close()


def free_context(browser: Browser, **settings: Any) -> BrowserContext:
    """A context without logins: one that rests after an earlier story, if there is one."""
    for context in browser.contexts:
        if all(page.url.endswith(_RESTING) for page in context.pages):
            context.clear_cookies()
            return context
    return browser.new_context(
        # Maps are drawn by the processor, with half the pixels in each direction.
        device_scale_factor=0.5,
        # Drones that glide would be drawn up to sixty times a second.
        reduced_motion="reduce",
        locale="en-GB",
        **settings,
    )


#: What axe looks for in each theme: all of it once, and then what depends on colours. Without
#: `resultTypes` axe describes each element that has no problem too, which takes a second.
_RULES: Final[dict[Literal["light", "dark"], dict[str, Any]]] = {
    "light": {"resultTypes": ["violations"]},
    "dark": {"resultTypes": ["violations"], "runOnly": ["color-contrast"]},
}


def serious_problems(page: Page) -> list[str]:
    """What axe finds serious in a page in both themes, when it has loaded."""
    problems: list[str] = []
    if not page.evaluate("() => 'axe' in window"):
        # Half a megabyte: once for all views of a page.
        page.evaluate(AXE_SCRIPT)
    for theme, rules in _RULES.items():
        page.emulate_media(color_scheme=theme)
        problems += [
            f"{theme}: {each['id']}: {node['html'][:120]}"
            for each in page.evaluate("rules => axe.run(rules)", rules)["violations"]
            if each["impact"] in {"serious", "critical"}
            for node in each["nodes"]
        ]
    return problems


class WatchedPage:
    """A page with all that must not happen in it: errors, and requests to other hosts."""

    def __init__(
        self,
        browser: Browser,
        base_url: str,
        *,
        viewport: ViewportSize | None = None,
    ) -> None:
        self.page: Page = free_context(browser).new_page()
        self.page.set_default_timeout(LONGEST_WAIT_MS)
        self.page.set_viewport_size(viewport or {"width": 390, "height": 844})
        self.foreign: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self._note_foreign(request.url, base_url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on(
            "console",
            lambda message: (
                self.errors.append(message.text) if "Security Policy" in message.text else None
            ),
        )

    def _note_foreign(self, url: str, base_url: str) -> None:
        if not url.startswith((base_url, "data:", "blob:")):
            self.foreign.append(url)
