"""Every process of Skyway ends with the exit code of the error that ends it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest
from skyway_drone_agent.enrolment.enrolled_drone import BrokerLogin, EnrolledDrone

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.secrets import make_secrets
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.planner.warm import MODEL
from skyway.runtime.errors import ExitCode

#: Runs a main once for each error, which everything that the main runs in its event loop raises in
#: a task group. It prints the exit codes.
RUN: Final = """
import asyncio, json, os, runpy, sys
from skyway.runtime.errors import DamagedDatabase, InvalidSettings, ServiceUnavailable

ERRORS = [
    LookupError("a bug"),
    InvalidSettings("SKYWAY_PORT: is missing"),
    ServiceUnavailable("database", "no connection"),
    DamagedDatabase("broken page"),
]
error = None

def refuse(*_, **__):
    for each in _:
        getattr(each, "close", lambda: None)()
    raise ExceptionGroup("unhandled errors in a TaskGroup", [ExceptionGroup("inner", [error])])

asyncio.Runner.run = refuse
os.nice = refuse  # the first call of the process that searches
codes = []
program, sys.argv = sys.argv[1], sys.argv[1:]
for error in ERRORS:
    try:
        exec(program, {}) if " " in program else runpy.run_module(program, run_name="__main__")
    except SystemExit as ended:
        codes.append(ended.code)
print(json.dumps(codes))
"""

SEARCH: Final = "skyway_composition.missions.queue.dispatching.search_process"

#: The arguments of every process that people, containers or other processes of Skyway start.
MAINS: Final = {
    "gateway": ["skyway_gateway"],
    "registry": ["skyway_provider_registry"],
    "composition": ["skyway_composition"],
    "migrate": ["skyway_composition", "migrate"],
    "broker": ["skyway_broker"],
    "drone agent": ["skyway_drone_agent", "--fleet", "fleet.json", "--journal", "journal"],
    "search": [f"from {SEARCH} import serve; serve()"],
    "skyway up": ["skyway.cli", "up", "--data", "data"],
    "skyway archive": ["skyway.cli", "archive", "files", "--data", "data"],
}


def write_fleet(file: Path) -> None:
    drone = EnrolledDrone(
        drone_id=DroneId("drn_1"),
        provider_id=ProviderId("prv_1"),
        model=MODEL,
        home_station_id=StationId("home"),
        home_position=Position(-98.0, 30.0),
        soc=1.0,
        mqtt=BrokerLogin(user_name="drn_1", password="secret"),
    )
    file.write_text(json.dumps([drone.model_dump(mode="json")]))


@pytest.mark.parametrize("main", MAINS)
@pytest.mark.long
def test_an_error_in_a_task_group_ends_a_process_with_its_own_exit_code(
    main: str, tmp_path: Path
) -> None:
    folder = DataFolder(tmp_path / "data")
    make_secrets(folder)
    write_fleet(tmp_path / "fleet.json")
    passwords = tmp_path / "passwords"
    passwords.touch()
    environment = {name: value for name, value in os.environ.items() if "SKYWAY" not in name}
    environment |= {
        "SKYWAY_DATABASE_URL": f"sqlite:///{tmp_path}/own.db",
        "SKYWAY_SECRETS_DIR": str(folder.secrets),
        "SKYWAY_MQTT_URL": "mqtt://127.0.0.1:9",
        "SKYWAY_BROKER_PASSWORD_FILE": str(passwords),
    }

    done = subprocess.run(
        [sys.executable, "-c", RUN, *MAINS[main]],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )

    expected = (
        ExitCode.FAILED,
        ExitCode.BAD_SETTINGS,
        ExitCode.NOT_NOW,
        ExitCode.BAD_DATABASE,
    )
    assert done.stdout.splitlines()[-1:] == [json.dumps(expected)], done.stderr
