"""A network with a server of composition of its own: a cell."""

import os
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

import httpx
import pytest
from typer.testing import CliRunner, Result

from skyway.cli.data_folder import DataFolder
from skyway.cli.main import make_app
from tests.end_to_end.cell_server import CellServer, cell_server
from tests.end_to_end.conftest import free_port
from tests.end_to_end.local_system import LocalSystem

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


@pytest.fixture
def system(tmp_path: Path) -> Iterator[LocalSystem]:
    """A running system of its own, because a table of cells holds for all its networks."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SKYWAY_")}
    environment["SKYWAY_CELL_HOSTS"] = "127.0.0.1"
    local = LocalSystem(DataFolder(tmp_path / "data"), environment)
    local.folder.make()
    try:
        local.start()
        yield local
    finally:
        local.stop()


def quote(system: LocalSystem, network: str, *, to: str | None = None) -> httpx.Response:
    destination = {"station_id": f"{to or network}-s3"}
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": destination}
    body = {"pickup": {"station_id": f"{network}-s1"}, "packages": [package]}
    return system.call("POST", "/v1/quotes", key=system.keys["SKYWAY_CUSTOMER_KEY"], body=body)


def run(system: LocalSystem, *arguments: str) -> Result:
    """`skyway cell` in this process, because a process of its own takes seconds to start."""
    command = ["cell", *arguments, "--data", str(system.folder.path)]
    return CliRunner().invoke(make_app(), command)


def refusal(system: LocalSystem, *arguments: str) -> str:
    """The reason with which `skyway cell` refuses."""
    done = run(system, *arguments)
    assert done.exit_code == 1, done.output
    return done.output


def accept(system: LocalSystem, *arguments: str) -> None:
    done = run(system, *arguments)
    assert done.exit_code == 0, done.output


def why_not_copied(source: CellServer, target: CellServer) -> str | None:
    """Copy a database; the work that its server still has to do, None after the copy."""
    urls = ["--from", source.database_url, "--to", target.database_url]
    done = CliRunner().invoke(make_app(), ["cell", "copy", *urls])
    assert done.exit_code == 0 or "missions are not over" in done.output, done.output
    return done.output if done.exit_code else None


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


def test_a_cell_works_alone_and_moves_when_it_is_idle(system: LocalSystem) -> None:
    with (
        cell_server("first", system, port=free_port()) as first,
        cell_server("second", system, port=free_port()) as second,
    ):
        first.start()
        assert "cannot be reached" in refusal(system, "add", "north", "--url", "http://127.0.0.1:1")
        system.publish_corridor("south")
        system.start_fleet(["south-s1"] * 2, name="South Air")
        first.until_ready()
        accept(system, "add", "north", "--url", first.url)
        assert "skyway cell move" in refusal(system, "add", "north", "--url", second.url)
        system.publish_corridor("north")
        system.start_fleet(["north-s1"], name="North Air")

        requested = [
            system.request_delivery([f"{each}-s2"], pickup=f"{each}-s1")
            for each in ("north", "south")
        ]
        flown = {system.until_state(each, "COMPLETED")["delivery_id"] for each in requested}

        assert missions(system) == (flown, None)
        between = quote(system, "north", to="south")
        assert between.status_code == 422
        assert "'south', the pickup 'north-s1' in 'north'" in between.text

        first.stop()

        stopped = quote(system, "north")
        assert (stopped.status_code, stopped.headers["Retry-After"]) == (503, "1")
        assert "the cell north" in stopped.json()["detail"]
        south = system.request_delivery(["south-s2"], pickup="south-s1")
        waiting = request_for_later(system, "north")
        system.until_state(south, "PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS", "COMPLETED")
        listed, silent = missions(system)
        assert south in listed
        assert silent == "the cell north"

        first.start()
        system.until_state(waiting, "PLANNED", "DISPATCHED")
        cancel(system, waiting)
        # A new one: the start of the server may have taken as long as a mission waits.
        later = request_for_later(system, "north")
        system.until_state(later, "PLANNED", "DISPATCHED")
        assert "skyway cell close north" in refusal(system, "move", "north", "--to", second.url)
        accept(system, "close", "north")
        assert "wait" in refusal(system, "move", "north", "--to", second.url)
        assert why_not_copied(first, second)
        closed = quote(system, "north")
        assert (closed.status_code, closed.headers["Retry-After"]) == (503, "1")
        assert "the cell north is unavailable: it is closed" in closed.json()["detail"]
        # A closed cell finishes its work, and a cancellation is part of it.
        cancel(system, later)
        system.eventually(
            lambda: why_not_copied(first, second) is None,
            "a copy after the end of all missions",
            instead=lambda: why_not_copied(first, second),
        )
        # What the old server accepted now would be lost.
        sealed = system.call(
            "POST",
            "/v1/stations/north-s3/closures",
            key=system.keys["SKYWAY_OPERATOR_KEY"],
            body={"until": None, "reason": "roof"},
        )
        assert (sealed.status_code, sealed.json()["code"]) == (503, "CELL_SEALED"), sealed.text
        assert "skyway cell unseal" in refusal(system, "open", "north")
        second.start()
        system.eventually(
            lambda: run(system, "move", "north", "--to", second.url).exit_code == 0, "the move"
        )
        # The old server is left running, and does no harm.

        moved = system.request_delivery(["north-s2"], pickup="north-s1")
        system.until_state(moved, "COMPLETED")

        listed, silent = missions(system)
        assert {*flown, south, waiting, later, moved} <= listed
        assert silent is None
        verified = system.command("verify", "--cell", second.database_url)
        assert verified.returncode == 0, verified.stdout + verified.stderr
        assert "0 violations in 4 databases" in verified.stdout
