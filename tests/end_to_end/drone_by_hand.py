"""A drone that enrols with a token and runs by hand, with `skyway drone`."""

import subprocess
import sys
from typing import Any

SKYWAY = (sys.executable, "-m", "skyway.cli")

_TERMS = {"name": "Test Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}


def register(system: Any, home: str, *, model_id: str = "paper-scenario") -> dict[str, Any]:
    """A new drone that has never connected, with its enrolment token."""
    provider_id = system.operate("POST", "/v1/providers", _TERMS)["provider_id"]
    body = {"model_id": model_id, "home_station_id": home}
    made: dict[str, Any] = system.operate("POST", f"/v1/providers/{provider_id}/drones", body)
    return made


def path_of(drone: dict[str, Any]) -> str:
    return f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"


def run(system: Any, *options: str, token: str | None = None) -> subprocess.Popen[bytes]:
    """`skyway drone` in the background."""
    variables = {} if token is None else {"SKYWAY_ENROLMENT_TOKEN": token}
    if "SKYWAY_MQTT_TLS_URL" in system.environment:
        # As in production: the drone shows the certificate that it got when it enrolled.
        variables["SKYWAY_MQTT_DRONE_URL"] = system.environment["SKYWAY_MQTT_TLS_URL"]
    with (system.folder.path / "drone.log").open("ab") as log:
        process = subprocess.Popen(
            [*SKYWAY, "drone", *options, "--data", str(system.folder.path)],
            stdout=log,
            stderr=log,
            env=system.environment | variables,
        )
    system.fleets.append(process)
    return process


def until(system: Any, drone: dict[str, Any], state: str) -> None:
    """Return once the cloud sees the drone in this state."""
    system.eventually(
        lambda: system.operate("GET", path_of(drone))["state"] == state,
        f"{drone['drone_id']} {state}",
        instead=lambda: system.operate("GET", path_of(drone)),
    )
