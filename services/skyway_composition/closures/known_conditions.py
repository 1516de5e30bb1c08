"""The conditions of a network, read again only when they have changed."""

from skyway.ids import NetworkId
from skyway.network.network import Network
from skyway.runtime.database import Database
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
            # The number first: what changes between the two reads then looks changed, and is.
            number = await store.conditions_number(connection, self._network_id)
            if number == self._number:
                return number, self._conditions
            closures = await store.in_force(connection, self._network_id, after_ms=after_ms)
        conditions = Conditions(self._conditions.network, closures)
        self._number, self._conditions = number, conditions
        return number, conditions
