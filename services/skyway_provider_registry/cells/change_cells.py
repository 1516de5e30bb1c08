"""Asks the servers of composition, and then adds, closes, opens and moves cells.

A move loses nothing: it needs an old server that has finished its work, whose database was sealed
before it was copied, and a new server with this copy.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from urllib.parse import urlsplit

from skyway.cells import CellClients
from skyway.contracts.cells import CELL_WORK, CellState, CellWork, NetworkCell
from skyway.errors import InvalidInput
from skyway.ids import NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound, RemoteProblem, RowRefused
from skyway.runtime.sql.database import Database
from skyway_provider_registry.cells import store


@dataclass(frozen=True, slots=True)
class CellChanges:
    """Changes the table of cells; every refusal says what to do."""

    db: Database
    servers: CellClients
    clock: FleetClock
    #: Patterns of the hosts that operators may name.
    hosts: Collection[str]

    async def add(self, network_id: NetworkId, *, url: str) -> NetworkCell:
        """Add a cell for a network at this server; a repeated call changes nothing.

        Raises
        ------
        InvalidInput
            The deployment does not allow this host.
        Conflict
            CELL_EXISTS, NETWORK_ELSEWHERE: the network has another server. WRONG_SERVER: the
            server does not know this address as its own. OTHER_VERSION: it is an older server.
        ServiceUnavailable
            The server, or the one that serves the network now, does not answer.
        """
        async with self.db.read() as connection:
            cell = await store.of(connection, network_id)
        if cell is not None:
            _refuse_another(cell, url)
            return cell
        await self._own_work(url)
        present = self.servers.default.url
        if url != present and network_id in (await self._work(present)).network_ids:
            raise Conflict(
                "NETWORK_ELSEWHERE",
                f"{network_id} is published at {present}: add its cell there (skyway cell add "
                f"{network_id} --url {present}), and move it",
            )
        try:
            async with self.db.write() as tx:
                await store.add(tx, network_id, url=url)
        except RowRefused:  # another call has added the cell in the meantime
            return await self.add(network_id, url=url)
        return await self._changed(network_id)

    async def set_state(self, network_id: NetworkId, state: CellState) -> NetworkCell:
        """Close a cell to new requests, or open it again; a repeated call changes nothing.

        Raises
        ------
        NotFound
            The network has no cell.
        Conflict
            CELL_SEALED: its server could not accept any request.
        ServiceUnavailable
            The cell is to be opened, and its server does not answer.
        """
        while (cell := await self._cell(network_id)).state != state:
            if state == "OPEN":
                _refuse_sealed(cell, await self._work(cell.url))
            async with self.db.write() as tx:
                if state == "CLOSED":
                    await store.close(tx, cell, wall_at=self.clock.wall_now())
                else:
                    await store.open_at(tx, [cell], url=cell.url)
        return await self._changed(network_id)

    async def move(self, network_id: NetworkId, *, url: str) -> NetworkCell:
        """Move the cell of a network to another server, and open it there.

        All cells of the old server move together, because they share one database.

        Raises
        ------
        NotFound
            The network has no cell.
        InvalidInput
            The deployment does not allow this host.
        Conflict
            CELL_OPEN, CELL_BUSY, CELL_NOT_ALONE, CELL_NOT_SEALED: the old server may still work.
            CELL_NOT_COPIED, OTHER_VERSION, WRONG_SERVER: the new server cannot take over.
            CELL_CHANGED: the table has changed.
        ServiceUnavailable
            The old or the new server does not answer.
        """
        cell = await self._cell(network_id)
        if cell.url == url:
            return cell
        async with self.db.read() as connection:
            moving = [each for each in await store.every(connection) if each.url == cell.url]
        _refuse_open(moving)
        old = await self._work(cell.url)
        _refuse_busy(cell, moving, old)
        new = await self._own_work(url)
        _refuse_other_version(cell, old, url=url, new=new)
        _refuse_another_copy(cell, old, url=url, new=new)
        _refuse_incomplete(cell, old, url=url, new=new)
        async with self.db.write() as tx:
            if not await store.open_at(tx, moving, url=url):
                raise Conflict("CELL_CHANGED", "another call has changed the cell: try again")
        return await self._changed(network_id)

    async def _changed(self, network_id: NetworkId) -> NetworkCell:
        """The cell after a change; this process reads the change before the caller gets it."""
        await self.servers.refresh()
        return await self._cell(network_id)

    async def _cell(self, network_id: NetworkId) -> NetworkCell:
        async with self.db.read() as connection:
            cell = await store.of(connection, network_id)
        if cell is None:
            raise NotFound("cell", network_id, advice="skyway cell list shows all, add adds one")
        return cell

    def _refuse_unknown_host(self, url: str) -> None:
        """Go on only if the services may show their secrets to the server at this address."""
        host = urlsplit(url).hostname or ""
        if url != self.servers.default.url and not any(_fits(host, each) for each in self.hosts):
            detail = f"the host {host} is not in SKYWAY_CELL_HOSTS of the registry"
            raise InvalidInput("url", detail)

    async def _own_work(self, url: str) -> CellWork:
        self._refuse_unknown_host(url)
        work = await self._work(url)
        if work.cell_url != url:
            raise Conflict(
                "WRONG_SERVER",
                f"the server at {url} has the SKYWAY_CELL_URL {work.cell_url}: set it to {url}, so "
                "that the server knows which networks are its own",
            )
        if work.revision is None:
            raise _older(url)
        return work

    async def _work(self, url: str) -> CellWork:
        async with self.servers.default.at(url).adding(f"composition at {url}", {}) as client:
            try:
                return await client.call("GET", CELL_WORK, answer=CellWork)
            except RemoteProblem as problem:
                raise _older(url) from problem


def _older(url: str) -> Conflict:
    return Conflict(
        "OTHER_VERSION",
        f"the server at {url} is no composition of this version of Skyway: upgrade the server, or "
        "correct the address",
    )


def _fits(host: str, pattern: str) -> bool:
    """Whether a host has this pattern. `*` stands for no dot, because a domain may be anybody's.

    Characters outside ASCII fit nothing: a name may have other dots, such as U+3002.
    """
    names, patterns = host.split("."), pattern.split(".")
    is_as_long = host.isascii() and len(names) == len(patterns)
    return is_as_long and all(map(fnmatchcase, names, patterns))


def _refuse_another(cell: NetworkCell, url: str) -> None:
    if cell.url != url:
        raise Conflict(
            "CELL_EXISTS",
            f"{cell.network_id} has a cell at {cell.url}: move it (skyway cell move "
            f"{cell.network_id} --to {url})",
        )


def _refuse_sealed(cell: NetworkCell, work: CellWork) -> None:
    if work.seal_id is not None:
        raise Conflict(
            "CELL_SEALED",
            f"the database at {cell.url} was sealed to be copied. Go on with the move (skyway cell "
            "move). If the cell stays at this server, run skyway cell unseal with the URL of the "
            "database, and open the cell after that",
        )


def _refuse_open(moving: Sequence[NetworkCell]) -> None:
    names = [each.network_id for each in moving if each.state == "OPEN"]
    if names:
        raise Conflict(
            "CELL_OPEN",
            f"{', '.join(names)} may accept new requests: close each cell of this server (skyway "
            f"cell close {names[0]}), and move them when their missions are over",
        )


def _refuse_busy(cell: NetworkCell, moving: Sequence[NetworkCell], work: CellWork) -> None:
    others = set(work.network_ids) - {each.network_id for each in moving}
    if others:
        raise Conflict(
            "CELL_NOT_ALONE",
            f"the server at {cell.url} also serves {', '.join(sorted(others))}, and a server moves "
            "as a whole: add and close their cells too",
        )
    if work.open_missions or work.held_offers or work.unsent:
        raise Conflict(
            "CELL_BUSY",
            f"{work.open_missions} missions are not over, {work.held_offers} offers are held and "
            f"{work.unsent} messages are unsent at {cell.url}: wait, and try again",
        )


def _refuse_other_version(cell: NetworkCell, old: CellWork, *, url: str, new: CellWork) -> None:
    if old.revision != new.revision:
        raise Conflict(
            "OTHER_VERSION",
            f"the database at {cell.url} stands at revision {old.revision}, and that at {url} at "
            f"{new.revision}: install the same version of Skyway at both, copy the database "
            "(skyway cell copy), and try again",
        )


def _refuse_another_copy(cell: NetworkCell, old: CellWork, *, url: str, new: CellWork) -> None:
    """Go on only if the new database is a copy of the old one, which has not changed since."""
    if old.seal_id is None:
        raise Conflict(
            "CELL_NOT_SEALED",
            f"the database at {cell.url} still accepts changes: copy it (skyway cell copy), which "
            "seals it, and try again",
        )
    if new.copied_seal_id != old.seal_id or new.seal_id is not None:
        raise Conflict(
            "CELL_NOT_COPIED",
            f"the database at {url} is no copy of the sealed database at {cell.url}, or was copied "
            "elsewhere itself: copy the database (skyway cell copy), and try again",
        )


def _refuse_incomplete(cell: NetworkCell, old: CellWork, *, url: str, new: CellWork) -> None:
    if set(old.network_ids) != set(new.network_ids):
        raise Conflict(
            "CELL_NOT_COPIED",
            f"the networks at {cell.url} are {_names(old)}, and those at {url} are {_names(new)}: "
            "copy the database (skyway cell copy), and try again",
        )
    for table, rows in old.rows.items():
        found = new.rows.get(table)
        if found != rows:
            raise Conflict(
                "CELL_NOT_COPIED",
                f"{table} has {rows} rows at {cell.url} and {found} at {url}: copy the database "
                "(skyway cell copy), and try again",
            )


def _names(work: CellWork) -> str:
    return ", ".join(work.network_ids) or "none"
