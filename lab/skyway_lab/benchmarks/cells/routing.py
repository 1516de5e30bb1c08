"""What it costs the gateway to find the server of a call, with one cell and with a hundred.

The gateway's own code runs on stand-ins for all servers: they answer in this process, so that only
routing and merging take time.
"""

import json
import tempfile
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Final

import httpx
from fastapi import Request
from skyway_gateway.clients import NetworkFinder
from skyway_gateway.forward.cell_routes import ForwardToCells
from skyway_gateway.forward.table import FORWARDED

from skyway.announced_networks import CachedNetworks
from skyway.cells import CellClients
from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity
from skyway.runtime.sql.database import Database

#: How many stations each network has.
_STATIONS: Final = 200
#: How often each call is repeated, and each call that asks many servers.
_CALLS: Final = 100
_CALLS_OF_MANY: Final = 10
#: The items of a page that a server answers.
_ITEMS: Final = 10


async def routing_rows(counts: tuple[int, ...]) -> list[tuple[str, ...]]:
    """Milliseconds of processor time of each kind of call, by the number of cells."""
    costs = [await _costs(count) for count in counts]
    return [(name, *(f"{each[name]:.3f}" for each in costs)) for name in costs[0]]


async def _costs(count: int) -> dict[str, float]:
    names = [NetworkId(f"region-{number:03}") for number in range(count)]
    cells = {name: f"http://{name}" for name in names}
    cached, last = CachedNetworks(), names[-1]
    for name in names:
        cached.put(_stations(name))

    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "service_gateway").write_text("a secret of the gateway\n")
        identity = ServiceIdentity("gateway", folder)
        transport = httpx.MockTransport(_answer)
        default = ServiceClient("composition", "http://composition", identity, transport=transport)
        servers = await stack.enter_async_context(CellClients(default, cells))
        finder = NetworkFinder(servers, cached, Database("sqlite:///not-opened"))
        to_cells = ForwardToCells(servers, finder)

        async def passed_on(template: str, **names_in_path: str) -> None:
            """Read from this path of the gateway, and read the answer to its end."""
            row = next(each for each in FORWARDED if (each.method, each.path) == ("GET", template))
            answer = await to_cells(_request(template, names_in_path), row, None)
            if hasattr(answer, "body_iterator"):
                async for _ in answer.body_iterator:
                    pass

        async def find() -> None:
            servers.open_for(await finder.of_station(StationId(f"{last}-s7")))

        station = f"{last}-s7"
        return {
            "find the server of a station": await _each_ms(find),
            "a call for a station": await _each_ms(
                lambda: passed_on("/v1/stations/{station_id}/pads", station_id=station)
            ),
            "a call for a mission, at the last server": await _each_ms(
                lambda: passed_on("/v1/missions/{mission_id}", mission_id=f"of-{last}"),
                calls=_CALLS_OF_MANY,
            ),
            "a list of all servers": await _each_ms(
                lambda: passed_on("/v1/alarms"), calls=_CALLS_OF_MANY
            ),
        }


async def _each_ms(call: Callable[[], Awaitable[object]], *, calls: int = _CALLS) -> float:
    """Milliseconds of this process's time for a call; the first call fills caches."""
    await call()
    began_s = time.process_time()
    for _ in range(calls):
        await call()
    return 1e3 * (time.process_time() - began_s) / calls


def _stations(network_id: NetworkId) -> NetworkStations:
    return NetworkStations(
        network_id=network_id,
        version=1,
        station_ids=tuple(StationId(f"{network_id}-s{n}") for n in range(_STATIONS)),
        positions=(Position(-98.0, 29.0),) * _STATIONS,
        parts=(0,) * _STATIONS,
    )


class _Body(httpx.AsyncByteStream):
    """A body that is not read yet, as it comes from a socket."""

    def __init__(self, content: bytes) -> None:
        self._content = content

    async def __aiter__(self):  # type: ignore[no-untyped-def]  # httpx types it
        yield self._content


def _answer(request: httpx.Request) -> httpx.Response:
    """The answer of the server at the host: each knows its own mission only."""
    host, path = request.url.host, request.url.path
    if path.startswith("/v1/missions/") and path != f"/v1/missions/of-{host}":
        return httpx.Response(404, stream=_Body(b'{"title": "Not found", "status": 404}'))
    items = [{"alarm_id": f"alm_{host}_{number}"} for number in range(_ITEMS)]
    body = json.dumps({"items": items, "next_cursor": None}).encode()
    return httpx.Response(200, stream=_Body(body))


def _request(template: str, names: dict[str, str]) -> Request:
    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": b"", "more_body": False}

    scope = {
        "type": "http",
        "method": "GET",
        "path": template.format(**names),
        "query_string": b"",
        "headers": [],
        "path_params": names,
        "server": ("gateway", 80),
        "scheme": "http",
    }
    return Request(scope, receive)
