"""What the refusal of each operation's worst bodies costs the event loop that refuses it."""

import asyncio
import json
import os
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx
from skyway_lab.benchmarks.hostile.worst_bodies import worst_bodies
from skyway_lab.benchmarks.load.city import NETWORK_ID, City
from skyway_lab.benchmarks.load.run import data_folder
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.gateway import read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.secrets import read_secret
from skyway.runtime.http.body_bounds import BODY_LIMIT_BYTES, BodyBounds

_DOCUMENTS: Final = Path(__file__).parents[4] / "openapi"
_METHODS: Final = ("post", "put", "patch", "delete")
#: Who calls a service itself: the one that all its internal calls, or most of them, are for.
_CALLERS: Final = {"provider-registry": "gateway", "composition": "gateway"}
_SERVICES: Final = {
    "gateway": "gateway",
    "registry": "provider-registry",
    "composition": "composition",
}
#: Each body is sent so often; the cheapest counts, because others are disturbed.
_TIMES: Final = 3
_IDLE_S: Final = 10.0
#: A caller's budgets would end the run.
_GENEROUS: Final = {
    "SKYWAY_REQUESTS_PER_S": "100000",
    "SKYWAY_REQUESTS_BURST": "100000",
    "SKYWAY_REFUSALS_PER_S": "100000",
    "SKYWAY_REFUSALS_BURST": "100000",
    "SKYWAY_ADDRESS_REQUESTS_PER_S": "100000",
    "SKYWAY_ADDRESS_REQUESTS_BURST": "1000000",
}
#: The status of a call whose connection was closed while the body was sent.
_CUT_OFF: Final = 0
_IDS: Final[Mapping[str, str]] = {"network_id": NETWORK_ID, "pad": "0"}


@dataclass(frozen=True, slots=True)
class Operation:
    """A call that takes a body, at the service that publishes it."""

    service: str
    method: str
    path: str
    bodies: tuple[tuple[str, bytes], ...]


@dataclass(frozen=True, slots=True)
class Cost:
    """The dearest refusal, in milliseconds of one event loop."""

    ms: float = 0.0
    kind: str = ""
    status: int = 0


@dataclass(slots=True)
class Caller:
    """Who calls: with the headers of a key, or with none."""

    name: str
    headers: Mapping[str, str]


async def refusals() -> Table:
    """Send every operation its worst bodies, with and without a key."""
    os.environ.update(_GENEROUS)
    table = Table(
        "hostile-bodies",
        "The dearest refusal of each operation, milliseconds of processor time of one event loop.",
        ("service", "operation", "no key", "with a key", "which body"),
    )
    async with _running() as system, httpx.AsyncClient(timeout=60.0) as client:
        callers = await _callers(system, client)
        idle = await _idle(system)
        for operation in operations():
            keyless = await _dearest(system, client, operation, Caller("nobody", {}), idle)
            keyed = Cost()
            for caller in callers[operation.service]:
                keyed = await _dearest(system, client, operation, caller, idle)
                if keyed.status not in (401, 403):
                    break
            table.rows.append(
                (
                    operation.service,
                    f"{operation.method.upper()} {operation.path}",
                    f"{keyless.ms:.1f}",
                    f"{keyed.ms:.1f}",
                    f"{keyed.kind} ({keyed.status})",
                )
            )
    return table


@asynccontextmanager
async def _running() -> AsyncIterator[System]:
    ports = Ports(gateway=0, broker=0)
    with data_folder() as folder, storage_pair("embedded", folder):
        async with running_system(folder, rate=60.0, ports=ports, say=print) as system:
            yield system


async def _callers(system: System, client: httpx.AsyncClient) -> dict[str, list[Caller]]:
    """Who may call each service, those who may most first."""
    gateway = system.urls["gateway"]
    operator = Caller("operator", _bearer(read_keys(system.folder)["SKYWAY_OPERATOR_KEY"]))

    async def made(method: str, path: str, body: Any) -> Any:  # the JSON of each route
        answer = await client.request(method, gateway + path, json=body, headers=operator.headers)
        return answer.raise_for_status().json()

    for network_id, document in City.of(stations=30, seed=1).documents().items():
        await made("PUT", f"/v1/networks/{network_id}", document)
    tariff = {"currency": "USD", "base": 1, "per_km": 1}
    provider = await made("POST", "/v1/providers", {"name": "Worst", "tariff": tariff})
    customer = await made("POST", "/v1/keys", {"role": "customer", "subject_id": "worst"})
    people = [
        operator,
        Caller("provider", _bearer(provider["key"])),
        Caller("customer", _bearer(customer["key"])),
    ]
    callers = {"gateway": people}
    for service, name in _CALLERS.items():
        secret = read_secret(system.folder, f"service_{name}")
        own = [
            Caller(who, {**_bearer(secret), "Skyway-Caller": who})
            for who in (f"service:{name}", "operator:op")
        ]
        callers[service] = own
    reporter = _bearer(read_secret(system.folder, "service_composition"))
    callers["gateway"] = [*people, Caller("composition", reporter)]
    return callers


def _bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def operations() -> Iterator[Operation]:
    """Every operation with a body of the three documents."""
    for service in _SERVICES.values():
        document = json.loads((_DOCUMENTS / f"{service}.json").read_text(encoding="utf-8"))
        schemas = document["components"]["schemas"]
        for path, item in document["paths"].items():
            for method in _METHODS:
                if (body := item.get(method, {}).get("requestBody")) is None:
                    continue
                schema = body["content"]["application/json"]["schema"]
                bounds = BodyBounds.of_schema(schema, schemas, limit_bytes=BODY_LIMIT_BYTES)
                bodies = worst_bodies(schema, schemas, limit_bytes=bounds.size_bytes)
                largest = ("above every limit", b"[" + b"1," * (BODY_LIMIT_BYTES // 2 - 2) + b"1]")
                yield Operation(service, method, path, (*bodies, largest))


async def _dearest(
    system: System,
    client: httpx.AsyncClient,
    operation: Operation,
    caller: Caller,
    idle: Mapping[str, float],
) -> Cost:
    """The dearest of the operation's bodies that are refused, without what an idle loop costs."""
    url = system.urls[_name_of(operation.service)] + _filled(operation.path)
    dearest = Cost()
    for kind, body in operation.bodies:
        found = Cost(float("inf"))
        for _ in range(_TIMES):
            before, began_s = _loops_ms(system), time.monotonic()
            status = await _sent(client, operation.method, url, body, caller)
            after = _loops_ms(system)
            took_s = time.monotonic() - began_s
            ms = max(after[name] - before[name] - took_s * idle[name] for name in after)
            found = min(found, Cost(ms, kind, status), key=lambda cost: cost.ms)
        if found.status >= 400 or found.status == _CUT_OFF:
            dearest = max(dearest, found, key=lambda cost: cost.ms)
    return dearest


async def _idle(system: System) -> dict[str, float]:
    """What each loop costs while nobody calls, milliseconds a second."""
    before = _loops_ms(system)
    await asyncio.sleep(_IDLE_S)
    after = _loops_ms(system)
    return {name: (after[name] - before[name]) / _IDLE_S for name in after}


async def _sent(
    client: httpx.AsyncClient, method: str, url: str, body: bytes, caller: Caller
) -> int:
    headers = {**caller.headers, "content-type": "application/json"}
    try:
        return (await client.request(method, url, content=body, headers=headers)).status_code
    except httpx.TransportError as error:
        print(f"{method} {url} as {caller.name}, {len(body)} bytes: {error!r}")
        return _CUT_OFF


def _filled(path: str) -> str:
    """The path with an id in the place of each parameter."""
    parts = (part.strip("{}") if part.startswith("{") else part for part in path.split("/"))
    return "/".join(_IDS.get(part, part) for part in parts)


def _name_of(document: str) -> str:
    return next(name for name, its_document in _SERVICES.items() if its_document == document)


def _loops_ms(system: System) -> dict[str, float]:
    """Processor time of the main thread of each service, which runs its event loop."""
    return {name: _main_thread_ms(system.supervisor.pid(name)) for name in _SERVICES}


def _main_thread_ms(pid: int | None) -> float:
    text = Path(f"/proc/{pid}/task/{pid}/schedstat").read_text(encoding="ascii")
    return int(text.split()[0]) / 1e6
