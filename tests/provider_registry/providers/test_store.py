"""Each statement of the providers finds only providers that the caller may see (I13)."""

from typing import Any

import pytest
from skyway_provider_registry.providers import store
from skyway_provider_registry.providers.provider import ProviderChange

from skyway.ids import ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database


async def test_a_provider_is_changed_by_itself_only(api: Any, db: Database) -> None:
    provider_id = ProviderId(await api.provider())
    changes = ProviderChange(name="stolen")

    for caller in (Caller("provider", "prv_thief"), Caller("customer", provider_id)):
        with pytest.raises(NotFound):
            async with db.write() as tx:
                await store.change(tx, caller, provider_id=provider_id, changes=changes)

    async with db.read() as connection:
        assert (await store.by_id(connection, provider_id)).name == "Hill Country Drones"
