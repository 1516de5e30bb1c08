"""A browser for stories: Debian's Chromium, driven by Playwright."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

CHROMIUM = shutil.which("chromium")

needs_browser = pytest.mark.skipif(
    CHROMIUM is None, reason="chromium is not installed: see .ci/run"
)

#: Milliseconds: longer than anything that a page waits for.
LONGEST_WAIT_MS = 60_000


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


class WatchedPage:
    """A page with all that must not happen in it: errors, and requests to other hosts."""

    def __init__(
        self,
        browser: Browser,
        base_url: str,
        *,
        viewport: ViewportSize | None = None,
    ) -> None:
        # Drones that glide would be drawn up to sixty times a second, by the processor.
        context = browser.new_context(
            viewport=viewport or {"width": 390, "height": 844},
            # Maps are drawn by the processor, with half the pixels in each direction.
            device_scale_factor=0.5,
            reduced_motion="reduce",
            locale="en-GB",
        )
        context.set_default_timeout(LONGEST_WAIT_MS)
        self.page: Page = context.new_page()
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
