"""Takes a picture of a view of the recorded world.

Texts have the font of the machine. Debian's Chromium brings DejaVu Sans.
"""

from collections.abc import Callable
from io import BytesIO
from typing import Any, Final
from urllib.parse import urlsplit

from PIL import Image
from playwright.sync_api import Browser

from tests.gateway.console.staged_page import LIVE, StagedPage
from tests.pictures.recorded_world import RecordedWorld, question
from tests.pictures.views import VIEWS, Screen

#: How often a page may be looked at, and how often it must look the same one after the other.
_MOST_LOOKS: Final = 100
_SAME_LOOKS: Final = 5

#: A view that reads again after seconds shows more the second time, such as rates.
_READ_ONCE: Final = "window.setInterval = () => 0;"
#: Whether the map of the page, if it has one, has drawn all that it has.
_IS_DRAWN: Final = """() => {
  const element = document.querySelector(".map");
  return element === null || Boolean(element.fleetMap?.map.loaded());
}"""


def _answered(world: RecordedWorld, role: str, path: str) -> Callable[[str], Any]:
    return lambda query: world.answers[role].get(question(path, query))


def _stage(browser: Browser, world: RecordedWorld, role: str, screen: Screen) -> StagedPage:
    context = browser.new_context(
        viewport={"width": screen.width, "height": screen.height},
        color_scheme=screen.theme,
        reduced_motion="reduce",
        locale="en-GB",
        timezone_id="UTC",
    )
    paths = {asked.partition("?")[0] for asked in world.answers[role]}
    answers: dict[str, Any] = {path: _answered(world, role, path) for path in paths}
    # The views were read one after the other, and each read the clock: one moment holds for all.
    answers["/v1/clock"] = {"now": world.now, "rate": world.rate}
    staged = StagedPage(browser, answers, context=context, draws_maps=True)
    staged.page.add_init_script(_READ_ONCE)
    staged.page.clock.set_fixed_time(world.wall_ms / 1000)
    return staged


def _still(staged: StagedPage) -> bytes:
    """What the page shows when it has asked for all, and no longer changes."""
    last: tuple[bytes, int] = (b"", 0)
    same = 0
    for _ in range(_MOST_LOOKS):
        staged.page.wait_for_load_state("networkidle")
        staged.page.wait_for_function(_IS_DRAWN)
        seen = (staged.page.screenshot(), len(staged.asked))
        same = same + 1 if seen == last else 1
        if same == _SAME_LOOKS:
            return seen[0]
        last = seen
    raise AssertionError("The page goes on changing.")


def picture_of(browser: Browser, world: RecordedWorld, view: str, screen: Screen) -> Image.Image:
    """A picture of this view on this screen."""
    role, pattern = VIEWS[view]
    address = pattern.format(**world.shown)
    staged = _stage(browser, world, role, screen)
    staged.open(f"/track/{address}" if role == "link" else f"/console#/{address}")
    for url, events in world.streams.get(role, {}).items():
        if url == LIVE or urlsplit(url).path.split("/")[-2] in address:
            for kind, value in events:
                staged.send(url, kind, value)
    taken = Image.open(BytesIO(_still(staged))).convert("RGB")
    assert staged.errors == []
    staged.page.context.close()
    return taken
