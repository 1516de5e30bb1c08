"""Which version of a network is the current one."""

from skyway.ids import NetworkId
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Database
from skyway_composition.networks import store
from skyway_composition.networks.store import VersionRow


async def current_row(db: Database, network_id: NetworkId) -> VersionRow:
    """The current version of a network, without its content.

    Raises
    ------
    NotFound
        There is no such network.
    """
    async with db.read() as connection:
        current = await store.current_version(connection, network_id)
    if current is None:
        raise NotFound("network", network_id)
    return current
