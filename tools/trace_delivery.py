"""Trace one delivery through all processes: which files it passes from POST to its last webhook.

python -m tools.trace_delivery           figures
python -m tools.trace_delivery --files   and the files and the calls between folders
python -m tools.trace_delivery --draw    and docs/pictures/way-of-a-delivery.svg

The tool starts `skyway up` in a temporary folder, lets one drone stand ready, and notes each Python
call in every process until the webhook `delivery.completed` arrives. Domain files are all files of
Skyway except `skyway/runtime`, `skyway/planner` and `skyway/cli`.

The first figures count all that runs during the delivery. The second figures leave out the broker,
the simulated drone, and the calls that the same processes also make while nobody requests anything.
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

from tools.draw_way import drawn

ROOT: Final = Path(__file__).resolve().parent.parent
PICTURE: Final = ROOT / "docs/pictures/way-of-a-delivery.svg"
SKYWAY: Final = (sys.executable, "-m", "skyway.cli")

#: Longest wait for any step, seconds of wall time.
LONGEST_WAIT_S: Final = 120.0

#: How long the system is watched while nobody requests anything, seconds of wall time.
IDLE_S: Final = 15.0

#: Files that the second figures leave out: a real fleet brings its own broker and vehicle.
_STAND_INS: Final = ("services/skyway_broker/", "services/skyway_drone_agent/simulated/")

#: A file of ours that calls another file of ours, and when first, nanoseconds of a clock that all
#: processes share. The caller is empty for a file of others.
Calls = dict[tuple[str, str], int]

#: Python runs a module of this name in each process, before all else. SIGUSR1 begins the notes,
#: SIGUSR2 writes them: a line for each pair of files of which one calls the other.
_NOTE_TAKER: Final = """
import json, os, signal, sys, threading, time
ROOT, FOLDER = os.environ["SKYWAY_TRACE_ROOT"] + "/", os.environ["SKYWAY_TRACE_FOLDER"]
active, calls, written = False, {}, 0

def note(frame, event, _):
    if active and event == "call" and frame.f_code.co_filename.startswith(ROOT):
        caller = frame.f_back.f_code.co_filename if frame.f_back else ""
        if frame.f_code.co_name != "<module>":
            pair = caller, frame.f_code.co_filename
            if pair not in calls:
                calls[pair] = time.monotonic_ns()

def begin(*_):
    global active
    active = True

def write(*_):
    global active, calls, written
    active, noted, calls, written = False, calls, {}, written + 1
    name = f"{FOLDER}/{os.getpid()}.{written}"
    with open(f"{name}.json", "w") as file:
        json.dump([[*pair, at_ns] for pair, at_ns in noted.items()], file)
    os.rename(f"{name}.json", f"{name}.done")

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


class Recorder:
    """Notes the calls of running processes, one recording after the other."""

    def __init__(self, folder: Path, pids: list[int]) -> None:
        self._folder = folder
        self._pids = pids
        self._recordings = 0

    @contextmanager
    def recording(self, calls: Calls) -> Iterator[None]:
        """Adds to `calls` what the processes call during the block."""
        self._recordings += 1
        self._signal(signal.SIGUSR1)
        yield
        self._signal(signal.SIGUSR2)
        notes = [self._folder / f"{pid}.{self._recordings}.done" for pid in self._pids]
        until(lambda: all(note.exists() for note in notes), "the notes of all processes")
        for note in notes:
            for caller, callee, at_ns in json.loads(note.read_text()):
                pair = short(caller), short(callee)
                calls[pair] = min(at_ns, calls.get(pair, at_ns))

    def _signal(self, number: signal.Signals) -> None:
        for pid in self._pids:
            os.kill(pid, number)


class Client:
    """Calls the gateway with the keys that `skyway up` wrote."""

    def __init__(self, folder: Path) -> None:
        self._keys = keys_of(folder)
        self._http = httpx.Client(base_url=self._keys["SKYWAY_GATEWAY_URL"], timeout=LONGEST_WAIT_S)

    def call(self, method: str, path: str, role: str, body: object = None) -> Any:
        """The answer of a route, called with the key of this role."""
        bearer = {"Authorization": f"Bearer {self._keys[f'SKYWAY_{role}_KEY']}"}
        return self._http.request(method, path, json=body, headers=bearer).raise_for_status().json()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()


def traced_calls(folder: Path) -> tuple[Calls, Calls]:
    """The calls between files during one delivery, and before it, when nobody requests any."""
    # With the notes on, the compiler of the planner would take longer than any wait.
    subprocess.run((sys.executable, "-m", "skyway.planner.warm"), check=True, cwd=ROOT)
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
        with closing(Client(folder)) as client:
            drones = registered_drone(client, folder)
            client.call("POST", "/v1/webhooks", "CUSTOMER", {"url": url})
            fleet = (*SKYWAY, "fleet", folder / "fleet.json")
            with process(*fleet, environment=environment, log=folder / "fleet.log") as agent:
                until(
                    lambda: (
                        client.call("GET", drones, "OPERATOR")["items"][0]["state"] == "AVAILABLE"
                    ),
                    "the drone to stand ready",
                )
                recorder = Recorder(folder, [*with_descendants(system), *with_descendants(agent)])
                idle: Calls = {}
                with recorder.recording(idle):
                    time.sleep(IDLE_S)
                busy: Calls = {}
                with recorder.recording(busy):
                    request_delivery(client)
                    until(lambda: "delivery.completed" in kinds, "the webhook delivery.completed")
    return busy, idle


def registered_drone(client: Client, folder: Path) -> str:
    """The path of a provider's drones, of which one can fly with the new `fleet.json`."""
    built = subprocess.run((*SKYWAY, "network", "build"), capture_output=True, check=True)
    client.call("PUT", "/v1/networks/texas-corridor", "OPERATOR", json.loads(built.stdout))
    terms = {"name": "Traced Air", "tariff": {"currency": "USD", "base": 1, "per_km": 1}}
    provider_id = client.call("POST", "/v1/providers", "OPERATOR", terms)["provider_id"]
    drones = f"/v1/providers/{provider_id}/drones"
    drone = {"model_id": "paper-scenario", "home_station_id": "san-marcos"}
    fleet = client.call("POST", drones, "OPERATOR", [drone])
    (folder / "fleet.json").write_text(json.dumps(fleet))
    return drones


def request_delivery(client: Client) -> None:
    """Request one delivery of one package."""
    package = {"mass_kg": 0.5, "destination": {"station_id": "mcqueeney"}}
    request = {
        "pickup": {"station_id": "san-marcos"},
        "packages": [{"package_id": "p1", **package}],
        "qos": {"objective": "FASTEST"},
    }
    client.call("POST", "/v1/deliveries", "CUSTOMER", request)


def is_domain(file: str) -> bool:
    """Whether a file of ours decides something about deliveries."""
    return not file.startswith(("skyway/runtime/", "skyway/planner/", "skyway/cli/"))


def short(file: str) -> str:
    """A file's path below the project; empty for files that are not ours."""
    inside = file.removeprefix(f"{ROOT}/")
    is_ours = inside != file and inside.startswith(("skyway/", "gateway/", "services/"))
    return inside if is_ours else ""


def part(file: str) -> str:
    """The service that a file belongs to; `skyway` for the library."""
    base, *inside = file.split("/")
    return base if base == "skyway" else inside[0]


def domain_files(calls: Calls) -> set[str]:
    """The domain files that these calls pass."""
    return {callee for _, callee in calls if callee and is_domain(callee)}


def own_calls(busy: Calls, idle: Calls) -> Calls:
    """What the delivery calls: without broker, simulation and background loops."""
    return {
        (a, b): at_ns
        for (a, b), at_ns in busy.items()
        if (a, b) not in idle and not b.startswith(_STAND_INS)
    }


def files_in_order(calls: Calls) -> list[str]:
    """The domain files that these calls pass, in the order of their first calls."""
    first: dict[str, int] = {}
    for (_, callee), at_ns in calls.items():
        if callee and is_domain(callee):
            first[callee] = min(at_ns, first.get(callee, at_ns))
    return sorted(first, key=lambda file: first[file])


def print_figures(title: str, calls: Calls, *, with_files: bool) -> None:
    """Print how many domain files and folders these calls pass, in all and in each service."""
    files = {callee for _, callee in calls if callee}
    domain = domain_files(calls)
    folders = {str(Path(file).parent) for file in domain}
    across = {(a, b) for a, b in calls if {a, b} <= domain and Path(a).parent != Path(b).parent}
    between = {(str(Path(a).parent), str(Path(b).parent)) for a, b in across}
    print(title)
    if with_files:
        print(*(f"  {file}" for file in sorted(domain)), sep="\n")
        print(*(f"  {a} -> {b}" for a, b in sorted(between)), sep="\n")
    print(f"  {len(domain)} domain files in {len(folders)} folders, {len(files)} files in all")
    print(f"  {len(between)} pairs of folders and {len(across)} pairs of files call across")
    files_of, folders_of = Counter(map(part, domain)), Counter(map(part, folders))
    for name, count in sorted(files_of.items()):
        print(f"    {name}: {count} files in {folders_of[name]} folders")


def main() -> int:
    """Trace one delivery and print the figures."""
    parser = argparse.ArgumentParser(description="Trace one delivery through all processes.")
    parser.add_argument("--files", action="store_true", help="print files and calls, too")
    parser.add_argument("--draw", action="store_true", help="draw the files in order, too")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="skyway-trace-") as folder:
        busy, idle = traced_calls(Path(folder))
    own = own_calls(busy, idle)
    print_figures("All that runs during a delivery", busy, with_files=options.files)
    print_figures("Without broker, simulation and background loops", own, with_files=options.files)
    if options.draw:
        PICTURE.write_text(drawn(files_in_order(own)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
