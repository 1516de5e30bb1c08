"""A gateway whose database refuses writes: reads go on, writes are answered with 503."""

from typing import Any

from tests.gateway.whole_gateway import Gateway, make_request

#: Makes a connection read-only for as long as it is open.
READ_ONLY = {
    "sqlite": "PRAGMA query_only = ON",
    "postgresql": "SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY",
}


async def refuse_next_write(gateway: Gateway) -> None:
    """Make the connection read-only on which the gateway writes."""
    async with gateway.parts.db.write() as tx:
        driver: Any = (await tx.connection.get_raw_connection()).driver_connection
    await driver.execute(READ_ONLY[gateway.parts.db.dialect])


async def test_a_read_only_database_is_answered_with_503_until_it_can_be_written(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    earlier = await gateway.accepted()
    cancelling = f"/v1/deliveries/{earlier}/cancel"

    await refuse_next_write(gateway)
    refused = await gateway.post(make_request())
    await refuse_next_write(gateway)
    not_cancelled = await gateway.http.post(cancelling, headers=gateway.customer)
    still_read = await gateway.get(earlier)

    assert [each.status_code for each in (refused, not_cancelled)] == [503, 503]
    assert refused.json()["detail"] == "database is unavailable: it is read-only now"
    assert refused.headers["retry-after"] == "1"
    assert still_read["state"] == "REQUESTED"
    assert await gateway.accepted()
