"""All SQL of known networks: a gateway that starts while composition is away checks requests."""

from collections.abc import Sequence

from sqlalchemy import select

from skyway.contracts.station_check import NetworkStations
from skyway.runtime.sql.database import Database
from skyway_gateway.tables import known_networks


async def keep_network(db: Database, stations: NetworkStations) -> None:
    """Store this version of a network in place of an older one."""
    row = {
        "network_id": stations.network_id,
        "version": stations.version,
        "stations": stations.model_dump_json(),
    }
    async with db.write() as tx:
        new = tx.insert(known_networks).values(row)
        await tx.execute(
            new.on_conflict_do_update(
                index_elements=["network_id"],
                set_={name: row[name] for name in ("version", "stations")},
                where=known_networks.c.version < stations.version,
            )
        )


async def read_networks(db: Database) -> Sequence[NetworkStations]:
    """The last known version of each network."""
    async with db.read() as connection:
        found = (await connection.execute(select(known_networks.c.stations))).scalars().all()
    return [NetworkStations.read(each) for each in found]
