"""A simulated drone whose link is lost for a while, on both brokers."""

from datetime import UTC, datetime, timedelta

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances, LinkLoss
from skyway_drone_agent.simulated.link_loss import LinkWithOutages, outages

from skyway.contracts.topics import ACKS, CONNECTION, INSTRUCTIONS
from skyway.contracts.world import ClockAnchor
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient

DRONE = DroneId("drone-1")
ACCOUNT = "p/drone-1"
NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
LOSSY = Disturbances(link=LinkLoss(share=1.0, every_s=600, for_s=30))


class SetClock(ManualClock):
    """A clock that does not wait for the cloud's time."""

    def keep(self, anchor: ClockAnchor) -> None:
        raise AssertionError(f"unexpected clock anchor: {anchor}")

    async def wait_until_set(self) -> None:
        return


async def test_during_an_outage_the_last_will_is_sent_and_no_message_passes(
    broker, connect, make, receive, all_connected, until
):
    clock = SetClock(NOON)
    outage = next(outages(NOON, disturbed=LOSSY, drone_id=DRONE))
    composition = await connect(broker.service_port, "composition")
    connections = composition.batches(CONNECTION)
    await all_connected(composition)
    client = MqttClient(
        f"mqtt://127.0.0.1:{broker.port}",
        client_id=ACCOUNT,
        user_name=ACCOUNT,
        password=ACCOUNT,
        will=lambda: (CONNECTION("p", DRONE), make.connection(1, "LOST")),
    )
    async with LinkWithOutages(client, clock, disturbed=LOSSY, drone_id=DRONE) as link:
        arrived = link.batches(INSTRUCTIONS("p", DRONE))
        await link.wait_connected()

        clock.advance(outage.from_at - clock.now())
        await link.wait_lost()
        [lost] = await receive(connections, 1)
        with pytest.raises(MqttUnavailable):
            await link.publish(ACKS("p", DRONE), make.ack(1))
        assert not link.is_connected

        clock.advance(outage.until_at - clock.now() - timedelta(seconds=1))
        assert not link.is_connected
        clock.advance(timedelta(seconds=1))
        await link.wait_connected()
        await composition.publish(INSTRUCTIONS("p", DRONE), make.instruction(1))
        await receive(arrived, 1)

    assert lost.message.status == "LOST"
