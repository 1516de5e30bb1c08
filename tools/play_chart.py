"""Play deploy/helm/skyway on this machine: install it, deliver, and replace the registry's pod.

sudo .venv/bin/python tools/play_chart.py

It needs Linux, root, PostgreSQL, Mosquitto, and .chart_tools (requirements-chart.txt). The
secrets and databases are made by the lines of docs/kubernetes.md, and each container of the chart
runs as in its pod (`pods_on_this_machine`). Nothing listens outside of a network of its own.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tools.pods_on_this_machine import IMAGE, ROOT, Document, Machine

#: Set in the process that has a network and mounts of its own.
_INSIDE: Final = "SKYWAY_PLAYS_CHART"
_PAGE: Final = ROOT / "docs/kubernetes.md"
_NAMES: Final = ("db.example.org", "skyway-gateway", "skyway-registry", "skyway-composition")
_VALUES: Final[Document] = {
    "database": {"host": "db.example.org"},
    "agents": {"enabled": True, "drones": 4},
}
_PORTS: Final = (8000, 8001, 8002)
#: The commands that the page runs in pods.
_EXEC: Final = re.compile(r"exec deployment/(\S+) -- (.+)")
_REQUEST: Final = {
    "pickup": {"station_id": "san-marcos"},
    "qos": {"objective": "FASTEST"},
    "packages": [{"package_id": "p1", "mass_kg": 0.8, "destination": {"station_id": "kyle"}}],
}


def main() -> int:
    """Play it in a network and mounts of its own."""
    if _INSIDE not in os.environ:
        again = ["unshare", "--mount", "--net", sys.executable, __file__]
        return subprocess.run(again, env={**os.environ, _INSIDE: "1"}, check=False).returncode
    folder = Path(tempfile.mkdtemp(prefix="skyway-chart-"))
    folder.chmod(0o755)
    try:
        _own_network(folder)
        page = _PAGE.read_text(encoding="utf-8")
        _shell(folder, _found(r"^skyway secrets --.+$", page))
        with _postgresql(folder):
            _shell(folder, _found(r"^for service in registry(.|\n)+?^done$", page))
            _play(folder)
    finally:
        shutil.rmtree(folder)
    return 0


def _play(folder: Path) -> None:
    """Start the pods in Helm's order, deliver, and replace the registry's pod."""
    documents = _rendered()
    kinds = ("Job", "Deployment")
    pods = {each["metadata"]["name"]: each for each in documents if each["kind"] in kinds}
    machine = Machine(
        folder / "pods",
        secrets=_secrets(folder),
        configs={d["metadata"]["name"]: d["data"] for d in documents if d["kind"] == "ConfigMap"},
        compiled=_compiled(folder),
    )
    customer = (folder / "cluster/secrets/customer_key").read_text().strip()
    operator = (folder / "cluster/secrets/operator_key").read_text().strip()
    try:
        for name, pod in pods.items():
            if pod["kind"] == "Job":
                machine.start(pod)
                print(f"{name} has ended")
        for name in ("skyway-gateway", "skyway-registry", "skyway-composition"):
            machine.start(pods[name])
        _until(_are_ready)
        print("gateway, registry and composition are ready")
        machine.start(pods["skyway-agents"])
        _until(lambda: "AVAILABLE" in _call("/v1/drones", operator)[1])
        print("the simulated drones are available")
        _until_planned(_request(customer), customer)
        print("a delivery is planned")
        began = time.monotonic()
        machine.stop("skyway-registry")
        delivery_id = _request(customer)
        print("the registry's pod has ended; a request is accepted meanwhile")
        machine.start(pods["skyway-registry"])
        _until(_are_ready)
        print(f"a new pod is ready after {time.monotonic() - began:.1f} s")
        _until_planned(delivery_id, customer)
        print(f"the delivery is planned after {time.monotonic() - began:.1f} s")
        for name, command in _EXEC.findall(_PAGE.read_text(encoding="utf-8")):
            machine.execute(pods[name], command.split())
            print(f"{command} finds nothing")
    finally:
        machine.stop_all()


def _rendered() -> Sequence[Document]:
    """The chart's objects, without those that need an operator."""
    script, chart = ROOT / "tests/chart/render_chart.py", ROOT / "deploy/helm/skyway"
    done = subprocess.run(
        [sys.executable, script, ROOT / ".chart_tools", chart],
        input=json.dumps({"played": _VALUES}),
        capture_output=True,
        text=True,
        check=True,
    )
    documents: Sequence[Document] = json.loads(done.stdout)["played"]["documents"]
    return documents


def _secrets(folder: Path) -> dict[str, Path]:
    """The folder of files of each Secret that the chart names by default."""
    cluster = folder / "cluster"
    own = {
        f"skyway-{name}-secrets": cluster / "service-secrets" / name
        for name in ("gateway", "registry", "composition")
    }
    return own | {
        "skyway-drone-ca": cluster / "drone-ca",
        "skyway-broker-tls": cluster / "broker",
        "skyway-commands": cluster / "service-secrets/commands",
    }


def _compiled(folder: Path) -> Path:
    """The compiled planner, as the Dockerfile leaves it."""
    print("compiling the planner, as the image does: about a minute")
    path = folder / "compiled"
    path.mkdir()
    warm = [sys.executable, "-m", "skyway.planner.warm"]
    image = {name: value for name, value in IMAGE.items() if name.startswith("NUMBA_")}
    environment = {**os.environ, **image, "NUMBA_CACHE_DIR": str(path)}
    subprocess.run(warm, cwd=ROOT, env=environment, check=True)
    return path


def _own_network(folder: Path) -> None:
    """Give the services and the database names in a network that ends with this process."""
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    hosts = folder / "hosts"
    hosts.write_text(f"127.0.0.1 localhost skyway-broker {' '.join(_NAMES)}\n")
    subprocess.run(["mount", "--bind", hosts, "/etc/hosts"], check=True)


def _shell(folder: Path, lines: str) -> None:
    """Run lines of the page there, with the checkout's `skyway` and the superuser's password."""
    password = folder / "cluster/postgres-passwords/superuser"
    environment = {**os.environ, "PATH": f"{ROOT}/.venv/bin:{_binaries()}:{os.environ['PATH']}"}
    if password.exists():
        environment["PGPASSWORD"] = password.read_text().strip()
    subprocess.run(["sh", "-ec", lines], cwd=folder, env=environment, check=True)


def _found(pattern: str, page: str) -> str:
    """The lines of the page."""
    found = re.search(pattern, page, re.MULTILINE)
    if found is None:
        raise LookupError(f"{_PAGE} has no lines {pattern}")
    return found[0]


@contextmanager
def _postgresql(folder: Path) -> Iterator[None]:
    """A new PostgreSQL that asks everybody for a password."""
    data, password = folder / "postgresql", folder / "superuser"
    shutil.copyfile(folder / "cluster/postgres-passwords/superuser", password)
    password.chmod(0o644)
    data.mkdir()
    shutil.chown(data, "postgres", "postgres")
    access = ["-U", "postgres", "-A", "scram-sha-256", f"--pwfile={password}"]
    _as_postgres(["initdb", "-D", data, *access])
    options = "-c unix_socket_directories= -c listen_addresses=127.0.0.1"
    _as_postgres(["pg_ctl", "-D", data, "-w", "-l", data / "log", "-o", options, "start"])
    try:
        yield
    finally:
        _as_postgres(["pg_ctl", "-D", data, "-w", "-m", "immediate", "stop"])


def _as_postgres(command: Sequence[str | Path]) -> None:
    """Run a program of PostgreSQL, which refuses to run as root."""
    user = ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"]
    quiet = subprocess.DEVNULL
    program = f"{_binaries()}/{command[0]}"
    subprocess.run([*user, program, *command[1:]], cwd="/", check=True, stdout=quiet)


def _binaries() -> str:
    """The folder of the newest PostgreSQL of this machine."""
    return str(max(Path("/usr/lib/postgresql").glob("*/bin")))


def _call(path: str, key: str, body: object = None, *, port: int = 8000) -> tuple[int, str]:
    """The status and the text of an answer; 0 when there is none."""
    headers = {"Authorization": f"Bearer {key}", "Content-Type": "application/json"}
    if body is not None:
        headers["Idempotency-Key"] = os.urandom(8).hex()
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", data, headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()
    except OSError as error:
        return 0, str(error)


def _are_ready() -> bool:
    return all(_call("/readyz", "", port=port)[0] == 200 for port in _PORTS)


def _request(key: str) -> str:
    """The id of a new delivery."""
    status, text = _call("/v1/deliveries", key, _REQUEST)
    if status >= 300:
        raise RuntimeError(f"no delivery: {status} {text}")
    answer: dict[str, Any] = json.loads(text)
    return str(answer["delivery_id"])


def _until_planned(delivery_id: str, key: str) -> None:
    states = ("PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS")
    _until(lambda: json.loads(_call(f"/v1/deliveries/{delivery_id}", key)[1])["state"] in states)


def _until(is_so: Callable[[], bool], *, within_s: float = 120.0) -> None:
    """Wait; an error when it takes too long."""
    ends_at = time.monotonic() + within_s
    while not is_so():
        if time.monotonic() > ends_at:
            raise TimeoutError(f"not within {within_s:.0f} s")
        time.sleep(0.05)


if __name__ == "__main__":
    sys.exit(main())
