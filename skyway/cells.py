"""The table of cells, cached in this process, and the clients of composition's servers.

Without rows everything goes to one server. The row of a network names another server, or closes the
network to new requests. Each request that follows a row carries the row's network and generation,
so that a server can refuse requests for a network that it no longer serves.
"""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Final, Generic, Self, TypeVar

from skyway.contracts.cells import CELL_HEADER, CELLS, CellTable, NetworkCell
from skyway.ids import NetworkId
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient

AnswerT = TypeVar("AnswerT")

#: Seconds of wall time between two reads of the table.
READ_EVERY_S: Final = 1.0

#: The same while there is no cell, and none can be added before the registry starts again.
_SELDOM_S: Final = 10.0

#: The server of all networks that have no row.
DEFAULT_SERVER: Final = "composition"

#: The longest wait for each server when all servers are asked, wall seconds.
ANSWERS_WITHIN_S: Final = 3.0

#: Reads the table from the service that keeps it; `ServiceUnavailable` without an answer.
ReadTable = Callable[[], Awaitable[CellTable]]
#: Stores a table that was read.
KeepTable = Callable[[CellTable], Awaitable[None]]


def table_from(registry: ServiceClient) -> ReadTable:
    """`ReadTable` that asks the registry."""

    async def read() -> CellTable:
        try:
            return await registry.call("GET", CELLS, answer=CellTable)
        except RemoteProblem as problem:
            raise ServiceUnavailable(
                "registry", f"it has no table of cells: {problem}"
            ) from problem

    return read


class Cells:
    """The table that this process read last; empty before the first read.

    `keep` gets each table that differs from the table kept before, for the next start.
    """

    def __init__(
        self,
        read: ReadTable,
        *,
        keep: KeepTable | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._read = read
        self._keep = keep
        self._now = now
        self._cells: Mapping[NetworkId, NetworkCell] = {}
        self._kept: Mapping[NetworkId, NetworkCell] = {}
        self._read_s: float | None = None
        self._may_grow = True

    def __iter__(self) -> Iterator[NetworkCell]:
        return iter(self._cells.values())

    def of(self, network_id: NetworkId) -> NetworkCell | None:
        """The row of a network; None if the network has none."""
        return self._cells.get(network_id)

    @property
    def age_s(self) -> float | None:
        """Wall seconds since the table was read; None before the first read."""
        return None if self._read_s is None else self._now() - self._read_s

    def polls(self) -> bool:
        """Whether to read the table now, a second or more after the last read."""
        is_old = self.age_s is None or self.age_s >= _SELDOM_S
        return self._may_grow or bool(self._cells) or is_old

    @property
    def newest(self) -> int:
        """The generation of the newest row; 0 without rows."""
        return max((each.generation for each in self._cells.values()), default=0)

    async def refresh(self) -> bool:
        """Step of a loop: read the table; always False.

        Raises
        ------
        ServiceUnavailable
            There is no answer; the cached table stays.
        """
        began_s = self._now()
        table = await self._read()
        self._cells = _by_network(table)
        self._read_s = began_s
        self._may_grow = table.may_grow
        if self._keep is not None and self._cells != self._kept:
            await self._keep(table)
            self._kept = self._cells
        return False

    def put(self, table: CellTable) -> None:
        """Use a stored table until the first read."""
        self._cells = self._kept = _by_network(table)


def _by_network(table: CellTable) -> Mapping[NetworkId, NetworkCell]:
    return {each.network_id: each for each in table.cells}


class CellClients:
    """The clients of all servers of composition, open until the `async with` block ends."""

    def __init__(self, default: ServiceClient, cells: Cells) -> None:
        self.cells = cells
        self._default = default
        self._opened = AsyncExitStack()
        self._by_url: dict[str, ServiceClient] = {default.url: default}

    async def __aenter__(self) -> Self:
        """Open the client of the default server; other clients open when the table names them."""
        await self._opened.__aenter__()
        await self._opened.enter_async_context(self._default)
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close all clients."""
        await self._opened.aclose()

    @property
    def has_cells(self) -> bool:
        """Whether any network has a cell; without one everything goes to the default server."""
        return any(True for _ in self.cells)

    @property
    def default(self) -> ServiceClient:
        """The server of all networks without a cell."""
        return self._default

    async def refresh(self) -> bool:
        """Step of a loop: read the table, and open clients of new servers; always False.

        Raises
        ------
        ServiceUnavailable
            The table cannot be read; the cached table stays.
        """
        try:
            await self.cells.refresh()
        finally:
            # Also of a table that was read and could not be kept.
            await self._open_new()
        return False

    async def begin_with(self, table: CellTable) -> None:
        """Use the table that an earlier process stored, or the current table if it can be read.

        Without a table, the first requests after a start would go to a server that does not serve
        their networks.
        """
        self.cells.put(table)
        with contextlib.suppress(ServiceUnavailable):
            await self.cells.refresh()
        await self._open_new()

    async def _open_new(self) -> None:
        for cell in self.cells:
            if cell.url not in self._by_url:
                client = self._default.at(cell.url)
                self._by_url[cell.url] = await self._opened.enter_async_context(client)

    def of(self, network_id: NetworkId | None) -> ServiceClient:
        """The server of a network; the default server if the network has no row or is None.

        Requests to a cell name the network and the generation of the network's row.
        """
        cell = None if network_id is None else self.cells.of(network_id)
        if cell is None:
            return self._default
        client = self._by_url.get(cell.url, self._default)
        return client.adding(_label(cell.network_id), {CELL_HEADER: cell.header})

    def open_for(self, network_id: NetworkId | None) -> ServiceClient:
        """The server of a network, for a new request.

        Raises
        ------
        ServiceUnavailable
            The cell is closed to new requests.
        """
        self.must_be_open(network_id)
        return self.of(network_id)

    def must_be_open(self, network_id: NetworkId | None) -> None:
        """Go on only if the network accepts new requests.

        Raises
        ------
        ServiceUnavailable
            The cell is closed to new requests.
        """
        cell = None if network_id is None else self.cells.of(network_id)
        if cell is not None and cell.state == "CLOSED":
            detail = "it is closed to new requests; an operator will open it again"
            raise ServiceUnavailable(_label(cell.network_id), detail)

    def serving(self, network_id: NetworkId | None) -> Sequence[ServiceClient]:
        """The server of a network; all servers if the network is None."""
        return list(self.every().values()) if network_id is None else [self.of(network_id)]

    def every(self) -> Mapping[str, ServiceClient]:
        """Each server once, by a name that says which networks it serves."""
        networks: dict[str, list[NetworkId]] = {}
        for cell in self.cells:
            networks.setdefault(cell.url, []).append(cell.network_id)
        networks.pop(self._default.url, None)
        others = {
            _label(*served): self._by_url[url].adding(_label(*served), {})
            for url, served in networks.items()
            if url in self._by_url
        }
        return {DEFAULT_SERVER: self._default, **others}


def _label(*network_ids: NetworkId) -> str:
    return f"the cell {', '.join(network_ids)}"


@dataclass(frozen=True, slots=True)
class Answers(Generic[AnswerT]):
    """The answers of servers, by the servers' names, and the servers that gave no answer."""

    given: Mapping[str, AnswerT]
    silent: Mapping[str, ServiceUnavailable]

    def must_be_whole(self) -> None:
        """Go on only if every server has answered.

        Raises
        ------
        ServiceUnavailable
            Names a server that has not answered.
        """
        for error in self.silent.values():
            raise error


async def ask_all(
    clients: Mapping[str, ServiceClient],
    ask: Callable[[ServiceClient], Awaitable[AnswerT]],
    *,
    within_s: float = ANSWERS_WITHIN_S,
) -> Answers[AnswerT]:
    """The answers of all servers, which are asked in parallel.

    Raises
    ------
    RemoteProblem
        A server answers with an error.
    """

    async def one(client: ServiceClient) -> AnswerT | ServiceUnavailable:
        try:
            async with asyncio.timeout(within_s):
                return await ask(client)
        except TimeoutError:
            return ServiceUnavailable(client.name, "it did not answer in time")
        except ServiceUnavailable as error:
            return error

    answers = dict(zip(clients, await asyncio.gather(*map(one, clients.values())), strict=True))
    return Answers(
        {name: each for name, each in answers.items() if not isinstance(each, ServiceUnavailable)},
        {name: each for name, each in answers.items() if isinstance(each, ServiceUnavailable)},
    )
