"""A real drone's options, and the errors when MAVLink cannot be used."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.mavlink.settings import PayloadRelease
from skyway_drone_agent.settings import read_settings

from skyway.runtime.errors import InvalidSettings

PLACES = ["--fleet", "fleet.json", "--journal", "here", "--mqtt-url", "mqtt://127.0.0.1:9"]


def test_without_a_vehicle_drones_are_simulated() -> None:
    assert read_settings(PLACES, {}).mavlink is None


def test_an_autopilots_address_payload_and_altitude_are_read() -> None:
    real = ["--vehicle", "mavlink:udpin:127.0.0.1:14550", "--payload", "servo:9:1900"]

    more = ["--altitude-m", "80", "--system-id", "7"]
    mavlink = read_settings([*PLACES, *real, *more], {}).mavlink

    assert mavlink is not None
    assert (mavlink.address, mavlink.altitude_m) == ("udpin:127.0.0.1:14550", 80.0)
    assert mavlink.system_id == 7
    assert mavlink.payload == PayloadRelease(9, pulse_us=1900)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--vehicle", "udpin:127.0.0.1:14550"], "a vehicle is mavlink:ADDRESS"),
        (["--vehicle", "mavlink:x", "--payload", "gripper"], "gripper:NUMBER or servo"),
        (["--vehicle", "mavlink:x", "--payload", "servo:9:100"], "500 to 2500"),
        (["--vehicle", "mavlink:x", "--altitude-m", "0"], "--altitude-m is 1 to 500, not 0"),
        (["--vehicle", "mavlink:x", "--system-id", "256"], "--system-id is 1 to 255, not 256"),
    ],
)
def test_wrong_options_are_named(options: list[str], message: str) -> None:
    with pytest.raises(InvalidSettings, match=message):
        read_settings([*PLACES, *options], {})


def run_agent(tmp_path: Path, drone: Any, program: str, *options: str) -> Any:
    fleet = tmp_path / "fleet.json"
    fleet.write_text(drone.model_dump_json())
    places = ["--fleet", str(fleet), "--journal", str(tmp_path / "journal")]
    return subprocess.run(
        [sys.executable, "-c", program, *places, "--mqtt-url", "mqtt://127.0.0.1:9", *options],
        capture_output=True,
        text=True,
        env=dict(os.environ),
        check=False,
        timeout=60,
    )


def test_a_missing_extra_is_named(tmp_path: Path, drone: Any) -> None:
    program = """
import runpy, sys
sys.modules["pymavlink"] = None
runpy.run_module("skyway_drone_agent", run_name="__main__")
"""
    done = run_agent(tmp_path, drone, program, "--vehicle", "mavlink:udpin:127.0.0.1:0")

    assert done.returncode == 2
    assert "pip install 'skyway[mavlink]'" in done.stderr


def test_an_address_that_cannot_be_opened_is_named(tmp_path: Path, drone: Any) -> None:
    program = "import runpy; runpy.run_module('skyway_drone_agent', run_name='__main__')"
    done = run_agent(tmp_path, drone, program, "--vehicle", "mavlink:udpin:203.0.113.1:1")

    assert done.returncode == 2
    assert "no MAVLink connection at udpin:203.0.113.1:1" in done.stderr
