"""Trace one delivery through all processes: which files it passes from POST to its last webhook.

python tools/trace_delivery.py           figures
python tools/trace_delivery.py --files   and the files and the calls between folders

The tool starts `skyway up` in a temporary folder, lets one drone stand ready, and then notes each
Python call in every process until the webhook `delivery.completed` arrives. Domain files are all
files of Skyway except `skyway/runtime`, `skyway/planner` and `skyway/cli`. Background loops run
during the delivery and count too.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

import httpx

ROOT: Final = Path(__file__).resolve().parent.parent
SKYWAY: Final = (sys.executable, "-m", "skyway.cli")

#: Longest wait for any step, seconds of wall time.
LONGEST_WAIT_S: Final = 120.0

#: Python runs a module of this name in each process, before all else. SIGUSR1 begins the notes,
#: SIGUSR2 writes them: a line for each pair of files of which one calls the other.
_NOTE_TAKER: Final = """
import json, os, signal, sys, threading
ROOT, FOLDER = os.environ["SKYWAY_TRACE_ROOT"] + "/", os.environ["SKYWAY_TRACE_FOLDER"]
active, calls = False, set()

def note(frame, event, _):
    if active and event == "call" and frame.f_code.co_filename.startswith(ROOT):
        caller = frame.f_back.f_code.co_filename if frame.f_back else ""
        if frame.f_code.co_name != "<module>":
            calls.add((caller, frame.f_code.co_filename))

def begin(*_):
    global active
    active = True

def write(*_):
    global active
    active = False
    with open(f"{FOLDER}/{os.getpid()}.json", "w") as file:
        json.dump(sorted(calls), file)
    os.rename(f"{FOLDER}/{os.getpid()}.json", f"{FOLDER}/{os.getpid()}.done")

signal.signal(signal.SIGUSR1, begin)
signal.signal(signal.SIGUSR2, write)
threading.setprofile(note)
sys.setprofile(note)
"""


def until(is_so: Callable[[], Any], what: str) -> Any:
    """What `is_so` returns once it is true."""
    end = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < end:
        if found := is_so():
            return found
        time.sleep(0.2)
    raise TimeoutError(f"not within {LONGEST_WAIT_S:.0f} s: {what}")


@contextmanager
def webhook_receiver(kinds: list[str]) -> Iterator[str]:
    """A server on loopback that appends the kind of each event to `kinds`; its URL."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(204)
            self.end_headers()
            kinds.append(json.loads(body)["type"])

        def log_message(self, *_: object) -> None:
            """Print nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@contextmanager
def process(*command: str | Path, environment: dict[str, str], log: Path) -> Iterator[int]:
    """A running process; its id. It ends with the block."""
    with log.open("wb") as file:
        started = subprocess.Popen(
            [str(part) for part in command], stdout=file, stderr=file, env=environment
        )
    try:
        yield started.pid
    finally:
        started.send_signal(signal.SIGTERM)
        started.wait(timeout=LONGEST_WAIT_S)


def with_descendants(pid: int) -> Iterator[int]:
    """A process and all that it started."""
    yield pid
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        yield from with_descendants(int(child))


def keys_of(folder: Path) -> dict[str, str]:
    """The addresses and keys that `skyway up` wrote for its user."""
    lines = (folder / "keys.env").read_text().splitlines()
    pairs = (line.removeprefix("export ").partition("=") for line in lines if "=" in line)
    return {name: value.strip("'\"") for name, _, value in pairs}


def traced_calls(folder: Path) -> set[tuple[str, str]]:
    """All pairs of files, of which the first calls the second, during one delivery."""
    (folder / "sitecustomize.py").write_text(_NOTE_TAKER)
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "SKYWAY_TRACE_ROOT": str(ROOT),
        "SKYWAY_TRACE_FOLDER": str(folder),
        "SKYWAY_DATA": str(folder),
    }
    kinds: list[str] = []
    up = (*SKYWAY, "up", "--rate", "900", "--port", "0", "--mqtt-port", "0")
    with (
        webhook_receiver(kinds) as url,
        process(*up, environment=environment, log=folder / "up.log") as system,
    ):
        until(lambda: "Skyway is up" in (folder / "up.log").read_text(), "skyway up")
        keys = keys_of(folder)
        api = httpx.Client(base_url=keys["SKYWAY_GATEWAY_URL"], timeout=LONGEST_WAIT_S)

        def call(method: str, path: str, role: str, body: object = None) -> Any:
            bearer = {"Authorization": f"Bearer {keys[f'SKYWAY_{role}_KEY']}"}
            return api.request(method, path, json=body, headers=bearer).raise_for_status().json()

        built = subprocess.run((*SKYWAY, "network", "build"), capture_output=True, check=True)
        call("PUT", "/v1/networks/texas-corridor", "OPERATOR", json.loads(built.stdout))
        terms = {"name": "Traced Air", "tariff": {"currency": "USD", "base": 1, "per_km": 1}}
        provider_id = call("POST", "/v1/providers", "OPERATOR", terms)["provider_id"]
        drones = f"/v1/providers/{provider_id}/drones"
        drone = {"model_id": "paper-scenario", "home_station_id": "san-marcos"}
        fleet_file = folder / "fleet.json"
        fleet_file.write_text(json.dumps(call("POST", drones, "OPERATOR", [drone])))
        call("POST", "/v1/webhooks", "CUSTOMER", {"url": url})
        fleet = process(
            *SKYWAY, "fleet", fleet_file, environment=environment, log=folder / "fleet.log"
        )
        with closing(api), fleet as agent:
            until(
                lambda: call("GET", drones, "OPERATOR")["items"][0]["state"] == "AVAILABLE",
                "the drone to stand ready",
            )
            pids = [*with_descendants(system), *with_descendants(agent)]
            _signal(pids, signal.SIGUSR1)
            package = {"mass_kg": 0.5, "destination": {"station_id": "mcqueeney"}}
            request = {
                "pickup": {"station_id": "san-marcos"},
                "packages": [{"package_id": "p1", **package}],
                "qos": {"objective": "fastest"},
            }
            call("POST", "/v1/deliveries", "CUSTOMER", request)
            until(lambda: "delivery.completed" in kinds, "the webhook delivery.completed")
            _signal(pids, signal.SIGUSR2)
            notes = [folder / f"{pid}.done" for pid in pids]
            until(lambda: all(note.exists() for note in notes), "the notes of all processes")
            return {tuple(pair) for note in notes for pair in json.loads(note.read_text())}


def _signal(pids: list[int], number: signal.Signals) -> None:
    for pid in pids:
        os.kill(pid, number)


def is_domain(file: str) -> bool:
    """Whether a file of ours decides something about deliveries."""
    return not file.startswith(("skyway/runtime/", "skyway/planner/", "skyway/cli/"))


def short(file: str) -> str:
    """A file's path below the project; empty for files that are not ours."""
    inside = file.removeprefix(f"{ROOT}/")
    is_ours = inside != file and inside.startswith(("skyway/", "gateway/", "services/"))
    return inside if is_ours else ""


def main() -> int:
    """Trace one delivery and print the figures."""
    parser = argparse.ArgumentParser(description="Trace one delivery through all processes.")
    parser.add_argument("--files", action="store_true", help="print files and calls, too")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="skyway-trace-") as folder:
        calls = {(short(a), short(b)) for a, b in traced_calls(Path(folder))}
    files = {callee for _, callee in calls if callee}
    domain = {file for file in files if is_domain(file)}
    folders = {str(Path(file).parent) for file in domain}
    between = Counter(
        (str(Path(a).parent), str(Path(b).parent))
        for a, b in calls
        if a in domain and b in domain and Path(a).parent != Path(b).parent
    )
    if options.files:
        print(*sorted(domain), sep="\n")
        print(*(f"{a} -> {b}" for a, b in sorted(between)), sep="\n")
    print(f"{len(domain)} domain files in {len(folders)} folders, {len(files)} files in all")
    print(f"{len(between)} pairs of folders and {between.total()} pairs of files call across")
    return 0


if __name__ == "__main__":
    sys.exit(main())
