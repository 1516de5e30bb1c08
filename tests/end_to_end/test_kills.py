"""Every process is killed in turn during a delivery, and the delivery still completes."""

from typing import Any

import pytest

pytestmark = pytest.mark.end_to_end

PROCESSES = (
    "skyway_gateway",
    "skyway_provider_registry",
    "skyway_composition",
    "skyway_broker",
    "skyway_drone_agent",
)


# Slow enough that a flight over two segments outlasts all kills.
@pytest.mark.fleet_rate(60.0)
@pytest.mark.storage_pair("embedded")
@pytest.mark.system_name("trouble")
@pytest.mark.long
def test_a_delivery_completes_while_every_process_is_killed_in_turn(system: Any) -> None:
    system.publish_corridor("killed")
    provider = system.start_fleet(["killed-s1"])
    delivery_id = system.request_delivery(["killed-s2", "killed-s3"], pickup="killed-s1")
    system.until_state(delivery_id, "IN_PROGRESS")

    for package in PROCESSES:
        killed = system.kill(package)
        if package == "skyway_drone_agent":
            system.run_fleet(provider["file"])
        assert system.pid_of(package) != killed

    delivery = system.until_state(delivery_id, "COMPLETED", "FAILED")
    assert delivery["state"] == "COMPLETED", delivery


@pytest.mark.storage_pair("postgresql-mosquitto")
def test_a_delivery_requested_before_a_kill_is_not_lost(system: Any) -> None:
    system.publish_corridor("kept")
    system.start_fleet(["kept-s1"])

    delivery_id = system.request_delivery(["kept-s2"], pickup="kept-s1")
    for package in ("skyway_gateway", "skyway_composition"):
        system.kill(package)

    delivery = system.until_state(delivery_id, "COMPLETED")
    assert delivery["packages"][0]["custodian"]["kind"] == "RECIPIENT"
