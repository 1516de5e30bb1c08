"""The conditions of a network, read again only when they have changed."""

from skyway.ids import NetworkId
from skyway.network.network import Network
from skyway.runtime.sql.database import Database
from skyway_composition.closures import store
from skyway_composition.closures.conditions import Conditions


class KnownConditions:
    """The conditions that were read last; which are current is asked each time."""

    def __init__(self, network_id: NetworkId, network: Network) -> None:
        self._network_id = network_id
        self._number = -1
        self._conditions = Conditions(network, ())

    async def read(self, db: Database, *, after_ms: int) -> tuple[int, Conditions]:
        """The number of the present conditions, and those of them that last beyond a moment."""
        async with db.read() as connection:
            number = await store.conditions_number(connection, self._network_id)
        return number, await self.numbered(number, db, after_ms=after_ms)

    async def numbered(self, number: int, db: Database, *, after_ms: int) -> Conditions:
        """The conditions of a number that has just been read.

        What has changed since looks changed to whoever compares the numbers, and is.
        """
        if number == self._number:
            return self._conditions
        async with db.read() as connection:
            closures = await store.in_force(connection, self._network_id, after_ms=after_ms)
        conditions = Conditions(self._conditions.network, closures)
        self._number, self._conditions = number, conditions
        return conditions
