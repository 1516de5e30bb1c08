"""Each statement of the fleets finds only drones that the caller may see (I13)."""

from typing import Any

import pytest
from skyway_provider_registry.fleets import store
from skyway_provider_registry.tables import drones, providers
from sqlalchemy import Table, update
from sqlalchemy.exc import IntegrityError

from skyway.ids import DroneId, ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database

OPERATOR = Caller("operator", "op")


@pytest.fixture
async def ids(api: Any) -> dict[str, Any]:
    """Another provider's drone, and the provider who wants it."""
    other = await api.provider()
    drone = await api.drone(other, name="Heron")
    return {"provider_id": ProviderId(other), "drone_id": DroneId(drone["drone_id"])}


@pytest.fixture
def thief() -> Caller:
    return Caller("provider", "prv_thief")


async def test_a_drone_is_read_by_its_owner_only(
    db: Database, ids: dict[str, Any], thief: Caller
) -> None:
    async with db.read() as connection:
        with pytest.raises(NotFound):
            await store.of_caller(connection, thief, **ids)
        assert (await store.of_caller(connection, OPERATOR, **ids)).name == "Heron"


async def test_a_drone_is_changed_by_its_owner_only(
    db: Database, ids: dict[str, Any], thief: Caller
) -> None:
    with pytest.raises(NotFound):
        async with db.write() as tx:
            await store.change(tx, thief, **ids, values={"name": "stolen"})

    async with db.read() as connection:
        assert (await store.of_caller(connection, OPERATOR, **ids)).name == "Heron"


async def test_a_drone_is_removed_by_its_owner_only(
    db: Database, ids: dict[str, Any], thief: Caller
) -> None:
    with pytest.raises(NotFound):
        async with db.write() as tx:
            await store.remove(tx, thief, **ids)

    async with db.read() as connection:
        assert (await store.of_caller(connection, OPERATOR, **ids)).name == "Heron"


async def test_a_drone_is_found_under_its_own_provider_only(
    db: Database, ids: dict[str, Any]
) -> None:
    elsewhere = {**ids, "provider_id": ProviderId("prv_thief")}

    with pytest.raises(NotFound):
        async with db.write() as tx:
            await store.remove(tx, OPERATOR, **elsewhere)
    with pytest.raises(NotFound):
        async with db.write() as tx:
            await store.change(tx, OPERATOR, **elsewhere, values={})


@pytest.mark.parametrize("table", [drones, providers])
async def test_the_database_stores_no_unknown_standby(
    db: Database, ids: dict[str, Any], table: Table
) -> None:
    assert ids

    with pytest.raises(IntegrityError):
        async with db.write() as tx:
            await tx.execute(update(table).values(standby="ROAM"))
