"""`skyway fleet` and `skyway drone` become agents and pass their options on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ENTRY = "from skyway.cli.entry import main; main()"


@pytest.mark.parametrize("command", ["fleet", "drone"])
def test_the_agent_gets_the_differences_and_refuses_impossible_ones(
    command: str, tmp_path: Path
) -> None:
    file = tmp_path / "fleet.json"
    file.write_text(json.dumps({"items": [{"drone_id": "drn_1"}]}))

    disturbed = ["--charge-time-factor", "-2", "--absent-station", "home"]

    done = subprocess.run(
        [sys.executable, "-c", ENTRY, command, file, *disturbed, "--data", tmp_path],
        capture_output=True,
        text=True,
        env={**os.environ, "SKYWAY_MQTT_URL": "mqtt://127.0.0.1:9"},
        check=False,
        timeout=60,
    )

    assert done.returncode == 2
    assert "charge_time_factor: must be above 0, not -2.0\n" in done.stderr


def test_a_drone_without_a_file_enrols_without_its_token_among_the_arguments(
    tmp_path: Path,
) -> None:
    api = "http://127.0.0.1:9"

    done = subprocess.run(
        [
            sys.executable,
            "-c",
            ENTRY,
            "drone",
            "--enrol",
            "enr_x",
            "--api",
            api,
            "--data",
            tmp_path,
        ],
        capture_output=True,
        text=True,
        env={**os.environ, "SKYWAY_MQTT_URL": "mqtt://127.0.0.1:9"},
        check=False,
        timeout=60,
    )

    assert done.returncode == 3
    assert f"{api} does not answer" in done.stderr
    assert "enr_x" not in done.stderr
