"""Take the pictures in docs/pictures: the console's views and the tracking page.

    python -m tests.pictures            of the recorded world
    python -m tests.pictures --record   and record the world anew, which takes six minutes

A recording runs `skyway up --demo` in a temporary folder and keeps what the gateway answers to each
view. Pictures of one recording are the same each time, so tests/pictures compares them. The tool
needs Chromium, as the stories in tests/end_to_end do.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import httpx
from PIL import Image
from playwright.sync_api import Browser, Error, Page, Response

from tests.end_to_end.browser import opened_browser
from tests.gateway.console.staged_page import LIVE
from tests.pictures.recorded_world import RecordedWorld, question, recorded_world
from tests.pictures.taken import picture_of
from tests.pictures.views import SCREENS, VIEWS

PICTURES: Final = Path(__file__).parents[2] / "docs/pictures"
_SETTLES_S: Final = 120.0
_COLOURS: Final = 256
#: A view that asks for nothing new for so long shows all that it shows, milliseconds.
_ASKED_WITHIN_MS: Final = 1_000
#: How long the first events of a stream may take, seconds.
_EVENTS_WITHIN_S: Final = 1.5


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


class _Recorder:
    """Looks at all views of a running system, and keeps the answers that they get."""

    def __init__(self, browser: Browser, keys: dict[str, str]) -> None:
        self._browser = browser
        self._keys = keys
        self._gateway = keys["SKYWAY_GATEWAY_URL"]
        self._answers: dict[str, dict[str, Any]] = {}

    def recorded(self) -> RecordedWorld:
        """The world as it is now.

        A second may be a minute of the world, so everybody is logged in before the first look.
        """
        roles = ("operator", "provider", "customer")
        pages = {role: self._logged_in(role) for role in roles}
        pages["link"] = self._new_page("link")
        shown = self._shown()
        streams = {role: dict(self._events(role, shown)) for role in roles}
        wall_ms, clock = int(1000 * time.time()), self._ask("operator", "/v1/clock")
        for role, page in pages.items():
            self._look(role, page, shown)
        return RecordedWorld(clock["now"], clock["rate"], wall_ms, shown, self._answers, streams)

    def _headers(self, role: str) -> dict[str, str]:
        key = self._keys.get(f"SKYWAY_{role.upper()}_KEY")
        return {"Authorization": f"Bearer {key}"} if key else {}

    def _ask(self, role: str, path: str) -> Any:  # JSON
        answer = httpx.get(self._gateway + path, headers=self._headers(role))
        return answer.raise_for_status().json()

    def _shown(self) -> dict[str, str]:
        """The drone that flies longest to its next customer, and what the addresses name of it."""
        picture = dict(self._first_events("operator", LIVE))["snapshot"]
        flights = []
        for delivery_id, delivery in picture["deliveries"].items():
            on_board = [p for p in delivery["packages"].values() if p["state"] == "IN_TRANSIT"]
            for mission in (picture["missions"].get(each, {}) for each in delivery["mission_ids"]):
                drone_id = mission.get("drone_id")
                landing = picture["drones"].get(drone_id, {}).get("next_landing")
                if on_board and landing:
                    next_at = min(each["eta_at"] for each in on_board)
                    flights.append((next_at, delivery_id, drone_id, landing["station_id"]))
        if not flights:
            raise RuntimeError("No drone carries a package now. Record again.")
        _, delivery_id, drone_id, station_id = max(flights)
        link = self._ask("operator", f"/v1/deliveries/{delivery_id}/tracking-link")
        return {
            "drone": drone_id,
            "station": station_id,
            "delivery": delivery_id,
            "link": urlsplit(link["tracking_url"]).path.removeprefix("/track/"),
        }

    def _first_events(self, role: str, path: str) -> list[tuple[str, Any]]:
        """The events that a stream sends when it is opened, as kind and JSON."""
        events: list[tuple[str, Any]] = []
        kind = "message"
        headers, timeout = self._headers(role), httpx.Timeout(30.0, read=_EVENTS_WITHIN_S)
        until = time.monotonic() + _EVENTS_WITHIN_S
        try:
            with httpx.stream(
                "GET", self._gateway + path, headers=headers, timeout=timeout
            ) as sent:
                for line in sent.iter_lines():
                    name, _, value = line.partition(": ")
                    if name == "event":
                        kind = value
                    elif name == "data":
                        events.append((kind, json.loads(value)))
                    if time.monotonic() > until or (path == LIVE and events):
                        break
        except httpx.ReadTimeout:
            pass  # The stream has sent what it had.
        return events

    def _events(self, role: str, shown: dict[str, str]) -> Iterator[tuple[str, Any]]:
        """By address: the first events of the streams that this role's views open."""
        paths = [LIVE]
        if role != "provider":
            paths.insert(0, f"/v1/deliveries/{shown['delivery']}/events")
        for path in paths:
            yield path, self._first_events(role, path)

    def _new_page(self, role: str) -> Page:
        self._answers[role] = {}
        return self._browser.new_page(locale="en-GB", timezone_id="UTC")

    def _logged_in(self, role: str) -> Page:
        """The console of this role, whose answers are kept from now on."""
        page = self._new_page(role)
        page.goto(f"{self._gateway}/console")
        page.fill("#key", self._keys[f"SKYWAY_{role.upper()}_KEY"])
        page.press("#key", "Enter")
        page.wait_for_selector("nav")
        page.wait_for_timeout(_ASKED_WITHIN_MS)
        page.on("response", partial(self._keep, role))
        page.reload()  # asks who is logged in
        self._wait(page, role)
        return page

    def _look(self, role: str, page: Page, shown: dict[str, str]) -> None:
        """Open all views of this role, one after the other."""
        if role == "link":
            page.on("response", partial(self._keep, role))
            page.goto(f"{self._gateway}/track/{shown['link']}")
            self._wait(page, role)
        for seen_by, address in VIEWS.values():
            if seen_by == role != "link":
                page.evaluate("to => { location.hash = to }", f"#/{address.format(**shown)}")
                self._wait(page, role)
        page.close()

    def _wait(self, page: Page, role: str) -> None:
        """Wait until a view no longer asks for more."""
        known = -1
        while len(self._answers[role]) > known:
            known = len(self._answers[role])
            page.wait_for_timeout(_ASKED_WITHIN_MS)

    def _keep(self, role: str, response: Response) -> None:
        asked = urlsplit(response.url)
        is_json = "json" in response.headers.get("content-type", "")
        is_file = asked.path.startswith("/console/")
        if response.request.method == "GET" and response.ok and is_json and not is_file:
            # The page may be at another address by now: then the body is gone.
            with suppress(Error):
                self._answers[role][question(asked.path, asked.query)] = response.json()


def record_world() -> None:
    """Run the small world for some minutes, and keep what its views show."""
    with (
        tempfile.TemporaryDirectory() as folder,
        _living_world(Path(folder)) as keys,
        opened_browser() as browser,
    ):
        _Recorder(browser, keys).recorded().save()


def save_pictures() -> None:
    """Replace all pictures."""
    world = recorded_world()
    for old in PICTURES.glob("*.png"):
        if old.stem.rpartition("-")[2] in SCREENS:
            old.unlink()
    with opened_browser() as browser:
        for view in VIEWS:
            for name, screen in SCREENS.items():
                taken = picture_of(browser, world, view, screen)
                # A picture with a palette has a third of the size.
                flat = taken.quantize(_COLOURS, dither=Image.Dither.NONE)
                flat.save(PICTURES / f"{view}-{name}.png", optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Take the pictures in docs/pictures.")
    parser.add_argument("--record", action="store_true", help="record the world anew before it")
    if parser.parse_args().record:
        record_world()
    save_pictures()
