"""A fleet on a windy day: plans are made again, and nobody flies below its reserve unawares."""

import subprocess
from typing import Any

import pytest
from ladders import QUICK_CHARGE, ladders

pytestmark = [pytest.mark.end_to_end, pytest.mark.fleet_rate(60.0)]

_RESERVE_SOC = 0.15

#: What telemetry's charge may be wrong by: sensors err on this day.
_ESTIMATE_ERROR = 0.015

#: Safe ends of a delivery: what is on board comes back where it cannot be brought.
_ENDS = ("COMPLETED", "PARTIALLY_COMPLETED", "FAILED", "REJECTED")

_BATTERY = {"BATTERY_LOW", "BATTERY_SHORT", "BATTERY_EMPTY"}


def test_a_windy_day_makes_other_plans_and_no_drone_falls_below_its_reserve_unawares(
    system: Any,
) -> None:
    names = ("gale", "gust", "calm")
    system.operate("PUT", "/v1/networks/ladders", ladders(*names))
    model = QUICK_CHARGE | {"model_id": "careful", "reserve_soc": _RESERVE_SOC}
    system.operate("PUT", "/v1/drone-models/careful", model)
    terms = {"name": "Windy Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
    provider_id = system.operate("POST", "/v1/providers", terms)["provider_id"]
    start_fleet(system, provider_id, homes=[f"{name}-{rail}1" for name in names for rail in "st"])

    ids = [
        system.request_delivery([f"{name}-{rail}4"], pickup=f"{name}-{rail}1")
        for name in names
        for rail in "st"
    ]
    ended = [system.until_state(each, *_ENDS, within_s=180) for each in ids]
    missions = [
        system.operate("GET", f"/v1/missions/{mission['mission_id']}")
        for delivery in ended
        for mission in delivery["missions"]
    ]

    assert any(each["mission"]["revision"] > 1 for each in missions)
    for delivery in ended:
        custodians = {package["custodian"]["kind"] for package in delivery["packages"]}
        assert delivery["state"] == "COMPLETED" or "DRONE" not in custodians, delivery
    warned = warned_drones(system)
    for drone in (each["mission"] for each in missions):
        is_warned = drone["drone_id"] in warned
        assert is_warned or least_soc(system, drone) >= _RESERVE_SOC - _ESTIMATE_ERROR
    verified = system.command("verify")
    assert verified.returncode == 0, verified.stdout + verified.stderr


def start_fleet(system: Any, provider_id: str, *, homes: list[str]) -> None:
    """`skyway fleet` with a drone at each home, once all of them can be sent somewhere."""
    command = ("--drones", str(len(homes)), "--model", "careful", "--provider-id", provider_id)
    at_home = [option for home in homes for option in ("--home", home)]
    day = ("--scenario", "windy", "--seed", "7")
    file = system.folder.path / "windy.json"
    process: subprocess.Popen[bytes] = system.run_fleet(file, *command, *at_home, *day)

    def are_available() -> bool:
        assert process.poll() is None
        drones = system.operate("GET", f"/v1/providers/{provider_id}/drones")["items"]
        states = [drone["state"] for drone in drones]
        return states == ["AVAILABLE"] * len(homes)

    system.eventually(are_available, within_s=60, what="the windy fleet")


def warned_drones(system: Any) -> set[str]:
    """Drones whose failsafes for a low battery have acted."""
    alarms = system.operate("GET", "/v1/alarms?limit=200")["items"]
    return {alarm["drone_id"] for alarm in alarms if alarm["code"] in _BATTERY}


def least_soc(system: Any, drone: dict[str, str]) -> float:
    """The least charge that the drone's telemetry shows."""
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/telemetry"
    rows = system.operate("GET", f"{path}?resolution=raw&limit=2000")["items"]
    assert rows
    return float(min(row["soc"] for row in rows))
