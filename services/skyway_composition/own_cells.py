"""Which networks this server serves, by the table of cells.

A request that follows a row of the table names its network and the row's generation. The server
refuses the request if another server serves the network, or if the sender has read an older row.

A server is retired when other servers serve all networks of its database: it was copied, and its
cells have moved, or will move to it. A retired server refuses requests, and its loops do nothing.
"""

import asyncio
from collections.abc import Awaitable, Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import ValidationError

from skyway.cells import Cells
from skyway.contracts.cells import NamedCell
from skyway.contracts.topics import Topic
from skyway.ids import DroneId, NetworkId
from skyway.runtime.errors import Misdirected, ServiceUnavailable
from skyway.runtime.mqtt.inbox import Arrival
from skyway.runtime.mqtt.signature_check import Reception
from skyway.runtime.sql.database import Database
from skyway_composition import cell_store
from skyway_composition.seal_store import seal_id

#: A step of a loop; whether there is more to do immediately.
Step = Callable[[], Awaitable[bool]]

#: A cell that has not read the table for so long books nothing, because it may have moved. Wall
#: seconds. Bookings need the registry anyway, for their candidates.
BOOKS_WITHIN_S: Final = 10.0

#: The server of a network that has no row, in texts of errors.
_NO_CELL: Final = "the server of networks without a cell"

#: The most drones whose networks are cached, about 200 bytes each.
_MOST_HOMES: Final = 200_000


@dataclass(slots=True)
class OwnCells:
    """The networks and drones of this server; `url` is its own address in the table of cells.

    `is_default`: whether this server serves the networks that have no cell. `networks` are those in
    its database; `is_sealed`: whether the database refuses changes, because it was copied.
    """

    cells: Cells
    url: str | None
    is_default: bool
    networks: Collection[NetworkId] = ()
    is_sealed: bool = False
    _homes: dict[str, NetworkId] = field(default_factory=dict)
    #: Wakes who waits for a change of the table.
    _refreshed: asyncio.Event = field(default_factory=asyncio.Event)

    def serves(self, network_id: NetworkId) -> bool:
        """Whether this server serves the network; True before the table was read."""
        cell = self.cells.of(network_id)
        if cell is None:
            return self.is_default or self.cells.age_s is None
        return cell.url == self.url

    @property
    def foreign(self) -> frozenset[NetworkId]:
        """The networks in this server's database that another server serves."""
        return frozenset(each for each in self.networks if not self.serves(each))

    @property
    def is_retired(self) -> bool:
        """Whether this server serves nothing of what is in its database.

        Before the table was read: whether the database is sealed.
        """
        if self.cells.age_s is None:
            return self.is_sealed
        return bool(self.networks) and len(self.foreign) == len(self.networks)

    async def read_database(self, db: Database) -> None:
        """Read which networks are in this server's database, and whether it is sealed."""
        async with db.read() as connection:
            self.networks = await cell_store.network_ids(connection)
            self.is_sealed = await seal_id(connection, "SEALED") is not None

    async def refresh(self, db: Database) -> bool:
        """Read the table of cells; whether this server now serves more of its database.

        Raises
        ------
        ServiceUnavailable
            There is no answer; the cached table stays.
        """
        served = self._served
        await self.cells.refresh()
        if self.cells.newest:
            await self.read_database(db)
        self._refreshed.set()
        self._refreshed.clear()
        return not self._served <= served

    async def read_table_once(self) -> None:
        """Read the table of cells, unless it was read before.

        A server that was started again must not answer drones of others: it never reads what they
        say to that, so its outbox would keep the instructions for ever, and its cell never move.

        Raises
        ------
        ServiceUnavailable
            There is no answer.
        """
        if self.cells.age_s is None:
            await self.cells.refresh()

    @property
    def has_drones(self) -> bool:
        """Whether any drone may be this server's: with cells, a server without networks has none.

        Without cells the networks are not read again, and every drone is this server's.
        """
        return not self.is_retired and bool(self._served or not self.cells.newest)

    @property
    def _served(self) -> frozenset[NetworkId]:
        return frozenset() if self.is_retired else frozenset(self.networks) - self.foreign

    async def until_active(self) -> None:
        """Wait until this server is not retired."""
        while self.is_retired:
            await self._refreshed.wait()

    def while_active(self, step: Step) -> Step:
        """A step of a loop that is left out while this server is retired."""

        async def active_step() -> bool:
            return not self.is_retired and await step()

        return active_step

    def refuse_when_retired(self) -> None:
        """Go on only if this server is not retired; for requests that name no network.

        Raises
        ------
        Misdirected
            Other servers serve all its networks.
        """
        if self.is_retired:
            names = ", ".join(self.networks)
            raise Misdirected(
                f"this server ({self.url}) serves none of the networks in its database ({names}). "
                "If its cells have moved, stop it, or give it an empty database"
            )

    def note_home(self, drone_id: DroneId, network_id: NetworkId | None) -> None:
        """Note the home network of a drone; None if the registry does not know it."""
        if len(self._homes) >= _MOST_HOMES:
            self._homes.clear()
        if network_id is not None:
            self._homes[drone_id] = network_id

    def is_foreign(self, drone_id: str) -> bool:
        """Whether another server handles the messages of this drone."""
        network_id = self._homes.get(drone_id)
        return network_id is not None and not self.serves(network_id)

    def refuse_foreign(self, network_id: NetworkId) -> None:
        """Go on only if this server serves this network; for requests without `CELL_HEADER`.

        Raises
        ------
        Misdirected
            Another server serves the network.
        """
        if not self.serves(network_id):
            cell = self.cells.of(network_id)
            other = _NO_CELL if cell is None else cell.url
            raise Misdirected(f"{network_id} is served by {other}, not by this server ({self.url})")

    async def refuse_misdirected(self, named: NamedCell, *, begins: bool) -> None:
        """Go on only if this server serves the network that a request names.

        `begins`: whether the request is for a quote, an offer or a booking.

        Raises
        ------
        Misdirected
            Another server serves the network, or the sender has read an older row.
        ServiceUnavailable
            The request begins something new, and the cell is closed, or it has not read the table
            for too long.
        """
        if named.generation > self.cells.newest:
            await self.cells.refresh()
        cell = self.cells.of(named.network_id)
        if cell is None or cell.url != self.url:
            other = _NO_CELL if cell is None else cell.url
            raise Misdirected(
                f"{named.network_id} is served by {other}, not by this server, whose "
                f"SKYWAY_CELL_URL is {self.url}"
            )
        if named.generation < cell.generation:
            raise Misdirected(f"the cell {cell.network_id} has changed: read the table again")
        if not begins:
            return
        name = f"the cell {cell.network_id}"
        if cell.state == "CLOSED":
            raise ServiceUnavailable(name, "it is closed to new requests")
        if self.cells.age_s is None or self.cells.age_s > BOOKS_WITHIN_S:
            raise ServiceUnavailable(name, "the registry does not say whether it has moved")

    async def refuse_unnamed(self, network_id: NetworkId) -> None:
        """Begin something only if this server serves a network that the request did not name.

        The sender has read no row of the network, but there may be one.

        Raises
        ------
        Misdirected
            Another server serves the network.
        ServiceUnavailable
            The cell is closed to new requests, or has not read the table for too long.
        """
        if (cell := self.cells.of(network_id)) is not None:
            await self.refuse_misdirected(NamedCell(network_id, cell.generation), begins=True)


@dataclass(frozen=True, slots=True)
class OwnDrones:
    """`Reception` of messages from this server's own drones; it drops all others unread."""

    reception: Reception
    own: OwnCells

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this process reads the messages of this sender."""
        is_own = self.own.has_drones and not self.own.is_foreign(ids[1])
        return is_own and self.reception.is_ours(ids)

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Whether to drop the messages of this sender, unread."""
        return self.reception.is_shut_out(ids)

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Handle an unreadable message from this sender. Any: each topic has its own type."""
        self.reception.unreadable(topic, ids, payload, error)

    def forged(self, arrival: Arrival) -> None:
        """Handle a message that is not from the drone that its topic names."""
        self.reception.forged(arrival)

    def postponed(self, ids: tuple[str, ...]) -> None:
        """Note that a message from this drone is not read now, and perhaps never."""
        self.reception.postponed(ids)
