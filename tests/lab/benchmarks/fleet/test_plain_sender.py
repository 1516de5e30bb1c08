"""The sender that speaks MQTT by hand is understood by the embedded broker."""

from pathlib import Path

import pytest
from skyway_lab.benchmarks.fleet.crew import accounts_of, crew_of
from skyway_lab.benchmarks.fleet.drone_messages import receiving
from skyway_lab.benchmarks.fleet.lines import Lines
from skyway_lab.benchmarks.fleet.own_broker import own_embedded
from skyway_lab.benchmarks.fleet.plain_sender import plain_sender

from skyway.errors import SkywayError

pytestmark = pytest.mark.integration


async def test_messages_arrive_whole(tmp_path: Path) -> None:
    (drone,) = crew_of(1, seed=1)
    lines = Lines.of(drone)
    with own_embedded(tmp_path, accounts_of([drone])) as broker:
        host, port = "127.0.0.1", int(broker.drones_url.rpartition(":")[2])
        async with (
            receiving(broker.services_url) as messages,
            plain_sender(host, port, user_name=drone.user_name, password="secret") as sender,
        ):
            for _ in range(3):
                sender.send(lines.telemetry_topic, lines.sample.now())
            sender.send_retained(lines.state_topic, lines.state.now())

            await messages.wait_airborne(1, within_s=300.0)
            assert (messages.samples, messages.states) == (3, 1)
            assert len(messages.late_s) == 4
            assert messages.airborne == {drone.drone_id}


async def test_a_refused_sender_gets_an_error(tmp_path: Path) -> None:
    (drone,) = crew_of(1, seed=1)
    with own_embedded(tmp_path, accounts_of([drone])) as broker:
        port = int(broker.drones_url.rpartition(":")[2])
        with pytest.raises(SkywayError, match="does not let prv_bench/drn_00000 in"):
            async with plain_sender("127.0.0.1", port, user_name=drone.user_name, password="wrong"):
                pass
