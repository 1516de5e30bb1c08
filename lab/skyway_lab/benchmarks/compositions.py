"""What `POST /v1/compositions` costs beside the solve, on a published network.

`python -m skyway_lab.compositions [--requests 100]` calls composition's app in this process, with
a database of its own, and composes the same problems without the service in turn. The figures are
processor time, so that other work on the machine counts little.
"""

import argparse
import asyncio
import json
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from fastapi import FastAPI
from skyway_composition.app import PACKAGE, composition_app
from skyway_composition.parts import Parts, parts_of, registry_client
from skyway_composition.settings import CompositionSettings

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.network.geojson import write_network
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.problem_document import read_problem
from skyway.runtime.http.app import nothing_to_open, nothing_to_wait_for
from skyway.runtime.sql.migrations import migrate

SEED: Final = 1
_SECRET: Final = "secret of gateway"
_STATIONS: Final = (1_000, 10_000)
_PACKAGES: Final = (1, 5)


def documents(network: Network, *, packages: int, count: int) -> Iterator[dict[str, Any]]:
    """Problems with so many packages for random stations, without their network."""
    chance = random.Random(SEED)
    stations = list(network.stations)
    for _ in range(count):
        source, *destinations = chance.sample(stations, packages + 1)
        yield {
            "drone": {"model": DJI_MATRICE_300_RTK.model_dump(mode="json"), "soc": 1.0},
            "source": source,
            "packages": [
                {"package_id": f"p{number}", "mass_kg": 0.3, "destination": destination}
                for number, destination in enumerate(destinations)
            ],
        }


async def call(app: FastAPI, method: str, path: str, body: bytes) -> bytes:
    """The body of the app's answer, without a server or a client between.

    Raises
    ------
    RuntimeError
        The answer is no success.
    """
    headers = {
        "authorization": f"Bearer {_SECRET}",
        "skyway-caller": "operator:op",
        "content-type": "application/json",
        "content-length": str(len(body)),
    }
    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method,
        "scheme": "http", "path": path, "raw_path": path.encode(), "query_string": b"",
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
        "client": ("127.0.0.1", 1), "server": ("composition", 80),
    }  # fmt: skip
    asked = iter([{"type": "http.request", "body": body, "more_body": False}])
    answers: list[Any] = []  # ASGI messages
    is_over = asyncio.Event()

    async def receive() -> dict[str, Any]:
        message = next(asked, None)
        if message is None:
            await is_over.wait()
            return {"type": "http.disconnect"}
        return message

    async def send(message: Any) -> None:  # an ASGI message
        answers.append(message)

    await app(scope, receive, send)
    is_over.set()
    answer = b"".join(message.get("body", b"") for message in answers)
    if answers[0]["status"] >= 300:
        raise RuntimeError(answer.decode())
    return answer


@contextmanager
def timed_ms(into: list[float]) -> Iterator[None]:
    """Append the milliseconds of processor time of the block."""
    began_s = time.process_time()
    yield
    into.append(1000 * (time.process_time() - began_s))


async def measure(app: FastAPI, network: Network, *, packages: int, count: int) -> str:
    """A line of the table."""
    airspace, hierarchy = Airspace.of(network), Hierarchy.of(network)
    served_ms: list[float] = []
    solved_ms: list[float] = []
    for document in documents(network, packages=packages, count=count):
        body = json.dumps({**document, "network": {"network_id": "city"}}).encode()
        with timed_ms(served_ms):
            answer = json.loads(await call(app, "POST", "/v1/compositions", body))
        problem = read_problem({**document, "network": network})
        with timed_ms(solved_ms):
            plan = compose(problem, airspace=airspace, hierarchy=hierarchy)
        if answer["delivery_time_s"] != plan.delivery_time_s:
            raise RuntimeError(f"{answer['delivery_time_s']} s instead of {plan.delivery_time_s} s")
    over_ms = [served - solved for served, solved in zip(served_ms, solved_ms, strict=True)]
    stations = len(network.stations)
    columns = (statistics.median(each) for each in (solved_ms, served_ms, over_ms))
    return f"| {stations:>8,} | {packages:>8} | {' | '.join(f'{each:>6.2f}' for each in columns)} |"


async def main(arguments: list[str]) -> int:
    """Measure and print the table; 0."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab.compositions", description=__doc__)
    parser.add_argument("--requests", type=int, default=100, help="of each line")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        parts = _parts(Path(folder))
        app = composition_app(parts, lifespan=nothing_to_open, readiness=nothing_to_wait_for)
        await migrate(f"sqlite:///{folder}/composition.db", PACKAGE)
        async with parts.db, parts.problems:
            await parts.problems.warm()
            print(f"seed {SEED}, {options.requests} requests a line; median ms of processor time")
            print("| stations | packages |  solve | served |   over |")
            for stations in _STATIONS:
                network = synthetic_city(stations=stations, seed=SEED)
                path = "/v1/networks/city"
                await call(app, "PUT", path, json.dumps(write_network(network)).encode())
                for packages in _PACKAGES:
                    count = options.requests
                    print(await measure(app, network, packages=packages, count=count), flush=True)
    return 0


def _parts(folder: Path) -> Parts:
    for name in ("gateway", "registry", "composition"):
        (folder / f"service_{name}").write_text(f"secret of {name}\n")
        (folder / f"mqtt_{name}").write_text(f"mqtt password of {name}\n")
    settings = CompositionSettings(
        database_url=f"sqlite:///{folder}/composition.db",
        mqtt_url="mqtt://not-opened",
        secrets_dir=folder,
    )
    return parts_of(settings, registry_client(settings))


if __name__ == "__main__":
    sys.exit(asyncio.run(main(sys.argv[1:])))
