"""Take the pictures in docs/pictures: the console's views and the tracking page, light and dark.

    python tools/picture_console.py

starts `skyway up --demo` in a temporary folder, lets it run for a minute and a half, and ends it.
It needs Chromium, as the stories in tests/end_to_end do.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

PICTURES: Final = Path(__file__).parent.parent / "docs/pictures"
_SETTLES_S: Final = 90.0
_COLOURS: Final = 256
_SIZE: Final = (1200, 750)
_PHONE_SIZE: Final = (390, 844)
#: How long a page may take until it shows what it shows, milliseconds.
_SHOWN_WITHIN_MS: Final = 4_000

#: The pictures: the role that sees them, and the address of the view. `{drone}` flies.
_VIEWS: Final = {
    "map": ("operator", "map/drone/{drone}"),
    "schedule": ("operator", "schedule"),
    "deliveries": ("operator", "deliveries"),
    "delivery": ("operator", "deliveries/{delivery}"),
    "alarms": ("operator", "alarms"),
    "fleet": ("operator", "fleet"),
    "replay": ("operator", "replay"),
    "health": ("operator", "health"),
    "new-delivery": ("customer", "new"),
    "keys": ("customer", "account"),
}


@contextmanager
def _living_world(folder: Path) -> Iterator[dict[str, str]]:
    """A running `skyway up --demo`; its addresses and keys."""
    command = [sys.executable, "-m", "skyway.cli", "up", "--demo", "--data", str(folder)]
    command += ["--port", "0", "--mqtt-port", "0"]
    environment = {n: v for n, v in os.environ.items() if not n.startswith("SKYWAY_")}
    world = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    try:
        time.sleep(_SETTLES_S)
        lines = (folder / "keys.env").read_text().splitlines()
        pairs = (line.removeprefix("export ").split("=", 1) for line in lines if "=" in line)
        yield {name: value.strip("'\"") for name, value in pairs}
    finally:
        world.terminate()
        world.wait()


def _ask(keys: dict[str, str], path: str) -> Any:  # JSON
    headers = {"Authorization": f"Bearer {keys['SKYWAY_OPERATOR_KEY']}"}
    return httpx.get(keys["SKYWAY_GATEWAY_URL"] + path, headers=headers).json()


def _shown(keys: dict[str, str]) -> dict[str, str]:
    """A drone in the air, its delivery, and the delivery's tracking page."""
    mission = _ask(keys, "/v1/missions?state=ACTIVE&limit=1")["items"][0]
    delivery_id = mission["delivery_id"]
    link = _ask(keys, f"/v1/deliveries/{delivery_id}/tracking-link")
    return {
        "drone": mission["drone_id"],
        "delivery": delivery_id,
        "tracking_url": link["tracking_url"],
    }


def _log_in(browser: Browser, keys: dict[str, str], *, role: str, theme: Any) -> Page:
    context = browser.new_context(
        viewport={"width": _SIZE[0], "height": _SIZE[1]}, color_scheme=theme, locale="en-GB"
    )
    page = context.new_page()
    page.goto(f"{keys['SKYWAY_GATEWAY_URL']}/console")
    page.fill("#key", keys[f"SKYWAY_{role.upper()}_KEY"])
    page.press("#key", "Enter")
    page.wait_for_selector("nav")
    return page


def _save_picture(page: Page, file: Path) -> None:
    """A picture with a palette, which is a third of the size."""
    page.screenshot(path=str(file))
    with Image.open(file) as picture:
        picture.quantize(_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)


def save_pictures() -> None:
    """Replace all pictures."""
    shutil.rmtree(PICTURES, ignore_errors=True)
    PICTURES.mkdir(parents=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        _living_world(Path(folder)) as keys,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        ids = _shown(keys)
        for theme in ("light", "dark"):
            for name, (role, address) in _VIEWS.items():
                page = _log_in(browser, keys, role=role, theme=theme)
                target = json.dumps(f"#/{address.format(**ids)}")
                page.evaluate(f"() => {{ location.hash = {target} }}")
                page.wait_for_timeout(_SHOWN_WITHIN_MS)
                _save_picture(page, PICTURES / f"{name}-{theme}.png")
                page.context.close()
            _save_tracking_page(browser, ids["tracking_url"], theme=theme)
        browser.close()


def _save_tracking_page(browser: Browser, url: str, *, theme: Any) -> None:
    context = browser.new_context(
        viewport={"width": _PHONE_SIZE[0], "height": _PHONE_SIZE[1]},
        color_scheme=theme,
        locale="en-GB",
    )
    page = context.new_page()
    page.goto(url)
    page.wait_for_timeout(_SHOWN_WITHIN_MS)
    _save_picture(page, PICTURES / f"tracking-{theme}.png")
    context.close()


if __name__ == "__main__":
    save_pictures()
