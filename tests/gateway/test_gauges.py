"""What the gateway shows to Prometheus of what stands now."""

from datetime import timedelta

from skyway_gateway.gauge_store import OPEN_ROWS
from skyway_gateway.gauges import GatewayGauges
from skyway_gateway.tables import outbox
from sqlalchemy import or_, select

from skyway.runtime.metrics import Gauges
from tests.gateway.whole_gateway import Gateway


async def shown(gateway: Gateway) -> dict[str, dict[str, float]]:
    """The numbers by name, and by the value of their label."""
    gauges = Gauges()
    gauges.show(*GatewayGauges(gateway.parts).sources())
    found: dict[str, dict[str, float]] = {}
    for gauge in await gauges.read():
        found.setdefault(gauge.name, {})[next(iter(gauge.labels.values()), "")] = gauge.value
    return found


async def test_nothing_is_counted_as_zero(gateway_on_both: Gateway) -> None:
    found = await shown(gateway_on_both)

    queues = ("booking", "waiting", "webhooks", "quotes", "problems", "reports")
    assert found["skyway_queue_depth"] == dict.fromkeys(queues, 0)
    assert found["skyway_queue_age_seconds"] == {"booking": 0.0, "waiting": 0.0, "webhooks": 0.0}
    assert found["skyway_outbox_depth"] == {"mqtt": 0, "composition": 0}
    assert set(found["skyway_deliveries"].values()) == {0}
    assert found["skyway_live_viewers"] == {"": 0}
    assert found["skyway_promised_packages"] == {"": 0}
    assert found["skyway_promised_packages_in_time"] == {"": 0}
    assert "skyway_live_age_seconds" not in found


async def test_deliveries_are_counted_until_they_are_over(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await gateway.planned()
    await gateway.accepted()

    found = await shown(gateway)

    assert found["skyway_deliveries"]["PLANNED"] == 1
    assert found["skyway_deliveries"]["REQUESTED"] == 1
    assert found["skyway_queue_depth"]["booking"] == 1


async def test_a_queue_is_as_old_as_its_first_work_has_been_due(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await gateway.accepted()
    gateway.clock.advance(timedelta(seconds=30))
    await gateway.accepted()
    gateway.clock.advance(timedelta(seconds=5))

    assert (await shown(gateway))["skyway_queue_age_seconds"]["booking"] == 35.0


async def test_loops_rest_only_while_no_delivery_is_open(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    open_row = select(or_(*OPEN_ROWS))
    async with gateway.parts.db.read() as connection:
        assert not (await connection.execute(open_row)).scalar_one()

    await gateway.planned()
    async with gateway.parts.db.write() as tx:
        await tx.execute(outbox.delete())

    async with gateway.parts.db.read() as connection:
        assert (await connection.execute(open_row)).scalar_one()
