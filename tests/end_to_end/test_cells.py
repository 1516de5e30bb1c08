"""A network with a server of composition of its own: a cell."""

import os
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from skyway.cli.data_folder import DataFolder
from tests.end_to_end.cell_server import cell_server
from tests.end_to_end.conftest import free_port
from tests.end_to_end.local_system import LocalSystem

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


@pytest.fixture
def system(tmp_path: Path) -> Iterator[LocalSystem]:
    """A system of its own, because the settings of cells hold for all its networks."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SKYWAY_")}
    local = LocalSystem(DataFolder(tmp_path / "data"), environment)
    local.folder.make()
    try:
        yield local
    finally:
        local.stop()


def quote(system: LocalSystem, network: str, *, to: str | None = None) -> httpx.Response:
    destination = {"station_id": f"{to or network}-s3"}
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": destination}
    body = {"pickup": {"station_id": f"{network}-s1"}, "packages": [package]}
    return system.call("POST", "/v1/quotes", key=system.keys["SKYWAY_CUSTOMER_KEY"], body=body)


def missions(system: LocalSystem) -> tuple[set[str], str | None]:
    """The deliveries of all listed missions, and the servers that gave no answer."""
    answer = system.call("GET", "/v1/missions", key=system.keys["SKYWAY_OPERATOR_KEY"])
    assert answer.status_code == 200, answer.text
    found = {each["delivery_id"] for each in answer.json()["items"]}
    return found, answer.headers.get("Skyway-Silent-Cells")


def request_for_later(system: LocalSystem, network: str) -> str:
    """The id of a delivery whose pickup is so late that its mission waits through the test."""
    now = datetime.fromisoformat(system.operate("GET", "/v1/clock")["now"])
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": f"{network}-s2"}}
    body = {
        "pickup": {"station_id": f"{network}-s1"},
        "packages": [package],
        "earliest_pickup_at": (now + timedelta(hours=20)).isoformat(),
    }
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    return str(system.call("POST", "/v1/deliveries", key=key, body=body).json()["delivery_id"])


def cancel(system: LocalSystem, delivery_id: str) -> None:
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", f"/v1/deliveries/{delivery_id}/cancel", key=key, body={})
    assert answer.json()["state"] == "CANCELLED", answer.text


def complete(system: LocalSystem, network: str) -> str:
    """The id of a delivery in this network that was flown to its end."""
    requested = system.request_delivery([f"{network}-s2"], pickup=f"{network}-s1")
    return str(system.until_state(requested, "COMPLETED")["delivery_id"])


def test_a_network_moves_to_a_cell_which_then_works_alone(system: LocalSystem) -> None:
    ports: dict[str, Any] = {"port": free_port(), "mqtt_port": free_port()}
    with cell_server("north", system, port=free_port()) as cell:
        system.start(**ports)
        for name in ("north", "south"):
            system.publish_corridor(name)
            system.start_fleet([f"{name}-s1"], name=f"{name} Air")
        flown = {complete(system, "north"), complete(system, "south")}
        later = request_for_later(system, "north")
        system.until_state(later, "PLANNED", "DISPATCHED")

        # First close the network, and let its missions come to an end.
        system.restart(**ports, SKYWAY_CLOSED_NETWORKS="north")
        closed = quote(system, "north")
        assert (closed.status_code, closed.headers["Retry-After"]) == (503, "1")
        assert "the network north is unavailable: it is closed" in closed.json()["detail"]
        flown.add(complete(system, "south"))
        network = system.operate("GET", "/v1/networks/north")
        too_early = system.refusal_to_start(**ports, SKYWAY_CELLS=f"north={cell.url}")
        assert f"SKYWAY_CELLS: north is at {cell.url}" in too_early
        assert "1 missions of it that are not over" in too_early
        system.restart(**ports)
        cancel(system, later)

        # Then change the setting, and publish the network at its new composition.
        system.restart(**ports, SKYWAY_CLOSED_NETWORKS="", SKYWAY_CELLS=f"north={cell.url}")
        cell.start()
        cell.until_ready()
        system.operate("PUT", "/v1/networks/north", network)
        flown |= {complete(system, "north"), complete(system, "south")}

        assert missions(system) == (flown | {later}, None)
        networks = system.operate("GET", "/v1/networks")["items"]
        assert [each["network_id"] for each in networks] == ["north", "south"]
        between = quote(system, "north", to="south")
        assert between.status_code == 422
        assert "'south', the pickup 'north-s1' in 'north'" in between.text

        cell.stop()

        stopped = quote(system, "north")
        assert (stopped.status_code, stopped.headers["Retry-After"]) == (503, "1")
        assert "the cell north" in stopped.json()["detail"]
        waiting = request_for_later(system, "north")
        south = complete(system, "south")
        listed, silent = missions(system)
        assert south in listed
        assert silent == "the cell north"

        cell.start()
        system.until_state(waiting, "PLANNED", "DISPATCHED")
        verified = system.command("verify", "--cell", cell.database_url)
        assert verified.returncode == 0, verified.stdout + verified.stderr
        assert "0 violations in 4 databases" in verified.stdout
