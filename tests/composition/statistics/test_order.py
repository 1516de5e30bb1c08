"""Lists are in the order in which the gateway merges those of several servers, in any database."""

from typing import Any

import pytest
from sqlalchemy import text

OPERATOR = "operator:op"


@pytest.mark.databases("postgresql")
async def test_a_database_that_sorts_by_a_language_lists_ids_by_their_bytes(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(stations="aBCde"))
    await composition(OPERATOR, "PUT", "/v1/networks/Zeta", make.network(stations="xyz"))
    async with composition.db.write() as tx:
        for table, column in (("stations", "station_id"), ("networks", "network_id")):
            by_language = f'ALTER TABLE {table} ALTER {column} TYPE text COLLATE "en-x-icu"'
            await tx.execute(text(by_language))

    listed: dict[str, list[str]] = {}
    for path, member in (("/v1/stats/pads", "station_id"), ("/v1/networks", "network_id")):
        query, listed[path] = "?limit=1", []
        while query:
            page = (await composition(OPERATOR, "GET", f"{path}{query}")).json()
            listed[path] += [each[member] for each in page["items"]]
            cursor = page["next_cursor"]
            query = f"?limit=1&cursor={cursor}" if cursor else ""

    assert listed == {
        "/v1/stats/pads": ["B", "C", "a", "d", "e", "x", "y", "z"],
        "/v1/networks": ["Zeta", "row"],
    }
