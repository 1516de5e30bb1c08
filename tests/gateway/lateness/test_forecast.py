"""The gateway learns from delivered packages, and gives new deliveries a P90."""

from datetime import datetime, timedelta
from typing import Any

from skyway_gateway.delivery_tables import packages
from skyway_gateway.lateness.calibrate import FEWEST
from sqlalchemy import update

from skyway.ids import NetworkId, ProviderId, StationId
from tests.gateway.whole_gateway import Gateway


async def deliver(gateway: Gateway, *, late: timedelta) -> str:
    """A delivery whose package came so much later than promised."""
    delivery_id = await gateway.planned()
    async with gateway.parts.db.write() as tx:
        late_ms = round(late.total_seconds() * 1000)
        await tx.execute(
            update(packages)
            .where(packages.c.delivery_id == delivery_id)
            .values(delivered_ms=packages.c.promised_ms + late_ms)
        )
    return delivery_id


def moment(package: dict[str, Any], name: str) -> datetime:
    return datetime.fromisoformat(package[name])


async def test_a_new_delivery_gets_a_p90_once_enough_packages_have_come(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    gateway.is_damaged = True  # packages that came without a report
    for _ in range(FEWEST):
        first = await deliver(gateway, late=timedelta(minutes=10))
    [before] = (await gateway.get(first))["packages"]
    forecast = gateway.parts.forecast
    for _ in range(2):
        await forecast.step()

    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))
    assert forecast.late_share(network_id, ProviderId("prv_new")) is not None
    assert forecast.late_share(NetworkId("elsewhere"), ProviderId("prv_new")) is None
    delivery_id = await gateway.planned()

    [package] = (await gateway.get(delivery_id))["packages"]
    assert (before["promised_p90_at"], before["eta_p90_at"]) == (None, None)
    margin = moment(package, "promised_p90_at") - moment(package, "promised_at")
    assert abs(margin - timedelta(minutes=10)) < timedelta(seconds=1)
    assert package["eta_p90_at"] == package["promised_p90_at"]
    await deliver(gateway, late=timedelta(minutes=9))
    gateway.clock.advance(timedelta(minutes=1))
    answer = await gateway.http.get("/v1/stats/deliveries", headers=gateway.operator)
    assert (answer.json()["packages_with_p90"], answer.json()["p90_share"]) == (1, 1.0)
