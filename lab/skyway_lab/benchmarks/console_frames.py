"""How smoothly the console draws many moving drones, how soon it shows a picture, and its bytes.

    python -m skyway_lab console_frames [DRONES]

opens the console of a `skyway up` with the bundled network in Chromium without a graphics card, and
moves DRONES drones (2,000) in its live picture twice a second, as the gateway would.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Final

import httpx
from playwright.sync_api import Page, sync_playwright

_SECONDS: Final = 10
_OPENED: Final = 5
_STARTS_WITHIN_S: Final = 60.0

#: Moves the drones on circles around the network, twice a second, in the page.
_MOVE: Final = """async (count) => {
  const {picture} = await import("/console/live.js");
  const {fleetNow} = await import("/console/fleet_clock.js");
  let step = 0;
  const drones = () => Object.fromEntries(Array.from({length: count}, (_, number) => {
    const angle = number + step / 20;
    const radius = 0.05 + 0.4 * (number / count);
    const position = [-98.2 + radius * Math.cos(angle), 29.6 + radius * Math.sin(angle)];
    return [`drone-${number}`, {position, soc: (number % 100) / 100, activity: "FLYING",
      at: new Date(fleetNow()).toISOString(), state: "ON_MISSION", mission_id: "m",
      heading_deg: number % 360, faults: []}];
  }));
  setInterval(() => { step += 1; picture.drones.value = drones(); }, 500);
}"""
_FRAMES: Final = """async (seconds) => {
  const {drones} = document.querySelector(".map").fleetMap;
  const before = drones.frames;
  await new Promise((done) => setTimeout(done, seconds * 1000));
  return (drones.frames - before) / seconds;
}"""
#: When the page first showed something, milliseconds, and the bytes that came, as they were sent.
_LOADED: Final = """() => ({
  paintMs: performance.getEntriesByName("first-contentful-paint")[0].startTime,
  bytes: performance.getEntriesByType("resource")
    .reduce((sum, each) => sum + each.encodedBodySize, 0),
  files: performance.getEntriesByType("resource").length,
})"""
_FIRST_PICTURE: Final = """() => {
  const map = document.querySelector(".map")?.fleetMap;
  return map?.stations.stations.length > 0 && map.map.areTilesLoaded();
}"""


@contextmanager
def _running_system(folder: Path) -> Iterator[dict[str, str]]:
    """A `skyway up` with the bundled network; its addresses and keys."""
    skyway = [sys.executable, "-m", "skyway.cli"]
    environment = {n: v for n, v in os.environ.items() if not n.startswith("SKYWAY_")}
    up = [*skyway, "up", "--data", str(folder), "--port", "0", "--mqtt-port", "0"]
    log = folder / "up.log"
    with log.open("wb") as written:
        system = subprocess.Popen(up, env=environment, stdout=written, stderr=written)
    try:
        latest = time.monotonic() + _STARTS_WITHIN_S
        while "Skyway is up" not in log.read_text():
            if system.poll() is not None or time.monotonic() > latest:
                raise RuntimeError(log.read_text())
            time.sleep(0.2)
        network = folder / "network.json"
        build = [*skyway, "network", "build"]
        network.write_bytes(subprocess.run(build, check=True, capture_output=True).stdout)
        publish = [*skyway, "network", "import", str(network), "--network-id", "texas-corridor"]
        subprocess.run([*publish, "--data", str(folder)], check=True, capture_output=True)
        lines = (folder / "keys.env").read_text().splitlines()
        pairs = (line.removeprefix("export ").split("=", 1) for line in lines if "=" in line)
        yield {name: value.strip("'\"") for name, value in pairs}
    finally:
        system.terminate()
        system.wait()


def _log_in(page: Page, keys: dict[str, str]) -> str:
    """Log in by a link; the address of the console."""
    gateway = keys["SKYWAY_GATEWAY_URL"]
    bearer = {"Authorization": f"Bearer {keys['SKYWAY_OPERATOR_KEY']}"}
    page.goto(httpx.post(f"{gateway}/v1/session-links", headers=bearer).json()["url"])
    page.wait_for_selector("nav")
    page.goto("about:blank")
    return f"{gateway}/console#/map"


def main(drones: int) -> None:
    """Print frames per second and the time to the first picture."""
    with (
        tempfile.TemporaryDirectory() as folder,
        _running_system(Path(folder)) as keys,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        console = _log_in(page, keys)
        opened: list[float] = []
        for _ in range(_OPENED):
            begun = time.monotonic()
            page.goto(console)
            page.wait_for_function(_FIRST_PICTURE)
            opened.append(time.monotonic() - begun)
            page.goto("about:blank")
        page.goto(console)
        page.wait_for_function(_FIRST_PICTURE)
        loaded = page.evaluate(_LOADED)
        page.evaluate(_MOVE, drones)
        rate = page.evaluate(_FRAMES, _SECONDS)
        browser.close()
    print(
        f"first picture after {median(opened):.2f} s: median of {_OPENED}; {max(opened):.2f} s most"
    )
    print(f"first paint after {loaded['paintMs']:.0f} ms, with all files in the browser's cache")
    print(f"{loaded['files']} files of {loaded['bytes'] / 1e6:.2f} MB, as they are sent")
    print(f"{drones} moving drones: {rate:.0f} frames/s in software rendering, 1280 x 800")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2_000)
