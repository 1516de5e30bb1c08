"""A gateway whose database refuses writes: reads go on, writes are answered with 503."""

from typing import Any

from tests.gateway.whole_gateway import Gateway, make_request

READ_ONLY = {
    "sqlite": "PRAGMA query_only = ON",
    "postgresql": "SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY",
}
READ_WRITE = {
    "sqlite": "PRAGMA query_only = OFF",
    "postgresql": "SET SESSION CHARACTERISTICS AS TRANSACTION READ WRITE",
}


async def writing_connection(gateway: Gateway) -> Any:
    """The driver's connection on which the gateway writes."""
    async with gateway.parts.db.write() as tx:
        return (await tx.connection.get_raw_connection()).driver_connection


async def test_a_read_only_database_is_answered_with_503_until_it_can_be_written(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    earlier = await gateway.accepted()
    connection, dialect = await writing_connection(gateway), gateway.parts.db.dialect
    await connection.execute(READ_ONLY[dialect])

    refused = await gateway.post(make_request())
    cancelled = await gateway.http.post(
        f"/v1/deliveries/{earlier}/cancel", headers=gateway.customer
    )
    still_read = await gateway.get(earlier)
    await connection.execute(READ_WRITE[dialect])

    assert [each.status_code for each in (refused, cancelled)] == [503, 503]
    assert refused.json()["detail"] == "database is unavailable: it is read-only now"
    assert refused.headers["retry-after"] == "1"
    assert still_read["state"] == "REQUESTED"
    assert await gateway.accepted()
