"""A fleet on a windy day: missions are replanned, unless a forecast has said the wind before."""

import json
from datetime import datetime, timedelta
from typing import Any

import pytest

from skyway.drone.models import PAPER_SCENARIO
from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("embedded"),
    pytest.mark.system_name("trouble"),
]

_RESERVE_SOC = 0.15

#: How far the charge in telemetry may be wrong: sensors err on this day.
_ESTIMATE_ERROR = 0.015

#: Flying east takes half as much energy again. Two rungs are planned on one charge, so the second
#: would end far below the reserve.
_HEAD_WIND = "[wind]\nmean_mps = 8.0\nfrom_deg = 90\n"

_BATTERY = {"BATTERY_LOW", "BATTERY_SHORT", "BATTERY_EMPTY"}


def test_in_strong_wind_missions_are_replanned_and_low_batteries_raise_alarms(
    system: Any,
) -> None:
    names = ("gale", "calm")
    system.operate("PUT", "/v1/networks/windy", ladders(*names, "head"))
    model = QUICK_CHARGE | {"model_id": "careful", "reserve_soc": _RESERVE_SOC}
    system.operate("PUT", "/v1/drone-models/careful", model)
    start_windy_fleet(system, homes=[f"{name}-{rail}1" for name in names for rail in "st"])
    head_wind = system.folder.path / "head-wind.toml"
    head_wind.write_text(_HEAD_WIND)
    system.start_fleet(["head-s1"], model_id="careful", options=("--scenario", str(head_wind)))

    against = system.request_delivery(["head-s4"], pickup="head-s1")
    ids = [against] + [
        system.request_delivery([f"{name}-{rail}4"], pickup=f"{name}-{rail}1")
        for name in names
        for rail in "st"
    ]
    ended = [system.until_ended(each) for each in ids]
    missions = [
        system.operate("GET", f"/v1/missions/{mission['mission_id']}")
        for delivery in ended
        for mission in delivery["missions"]
    ]

    assert ended[0]["state"] == "COMPLETED", ended[0]
    assert missions[0]["mission"]["delivery_id"] == against
    assert missions[0]["mission"]["revision"] > 1, missions[0]
    for delivery in ended:
        custodians = {package["custodian"]["kind"] for package in delivery["packages"]}
        assert delivery["state"] == "COMPLETED" or "DRONE" not in custodians, delivery
    least = {each["mission"]["drone_id"]: least_soc(system, each["mission"]) for each in missions}
    low = {drone_id for drone_id, soc in least.items() if soc < _RESERVE_SOC - _ESTIMATE_ERROR}
    # Some drones still fly home, and warn before they are low. Alarms take another path than
    # telemetry and may come later.
    providers = {each["mission"]["provider_id"] for each in missions}
    system.eventually(
        lambda: low <= warned_drones(system, providers), "a warning of each", instead=lambda: least
    )


def test_a_delivery_in_a_forecast_wind_is_flown_as_planned(system: Any) -> None:
    published = system.operate("PUT", "/v1/networks/foretold", ladders("foretold"))
    model = QUICK_CHARGE | {"model_id": "careful", "reserve_soc": _RESERVE_SOC}
    system.operate("PUT", "/v1/drone-models/careful", model)
    head_wind = system.folder.path / "foretold-wind.toml"
    head_wind.write_text(_HEAD_WIND)
    system.start_fleet(["foretold-s1"], model_id="careful", options=("--scenario", str(head_wind)))
    still = quoted(system, "foretold-s1", "foretold-s2")

    file = system.folder.path / "forecast.json"
    file.write_text(json.dumps(forecast_of_head_wind(published["published_at"])))
    sent = system.command("network", "weather", str(file), "--network-id", "foretold")
    windy = quoted(system, "foretold-s1", "foretold-s2")
    ended = system.until_ended(
        system.request_delivery(["foretold-s2", "foretold-s4"], pickup="foretold-s1")
    )

    assert sent.stdout.startswith("foretold: VALID, from a test"), sent
    assert (still["weather"], windy["weather"]["source"]) == (None, "a test")
    hand_overs_s = 60.0
    flown_s = [each["delivery_time_s"] - hand_overs_s for each in (still, windy)]
    speeds_mps = PAPER_SCENARIO.speed_empty_mps, PAPER_SCENARIO.speed_full_mps
    longer = max(speed / (speed - 8.0) for speed in speeds_mps)
    assert flown_s[1] / flown_s[0] == pytest.approx(longer, abs=0.02)
    assert ended["state"] == "COMPLETED", ended
    (mission,) = ended["missions"]
    assert (mission["revision"], mission["weather"]["source"]) == (1, "a test"), mission


def quoted(system: Any, pickup: str, destination: str) -> dict[str, Any]:
    """The best offer for one package."""
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": destination}}
    body = {"pickup": {"station_id": pickup}, "packages": [package]}
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", "/v1/quotes", key=key, body=body)
    offer: dict[str, Any] = answer.json()["offers"][0]
    return offer


def forecast_of_head_wind(now: str) -> dict[str, Any]:
    """8 m/s from the east for two days around this moment, as the drones will meet them."""
    times = [datetime.fromisoformat(now) + timedelta(days=day) for day in (-1, 1)]
    grid = {
        "time": [each.isoformat() for each in times],
        "latitude": [29.0, 30.0],
        "longitude": [-98.5, -97.0],
        "wind_speed_mps": [[[8.0] * 2] * 2] * 2,
        "wind_from_deg": [[[90.0] * 2] * 2] * 2,
    }
    return {"source": "a test", "issued_at": now, "grid": grid}


def start_windy_fleet(system: Any, *, homes: list[str]) -> None:
    """Run `skyway fleet` with a drone at each home until all drones are AVAILABLE."""
    terms = {"name": "Windy Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
    provider_id = system.operate("POST", "/v1/providers", terms)["provider_id"]
    command = ("--drones", str(len(homes)), "--model", "careful", "--provider", provider_id)
    home_options = [option for home in homes for option in ("--home", home)]
    day = ("--scenario", "windy", "--seed", "7")
    system.run_fleet(system.folder.path / "windy.json", *command, *home_options, *day)
    system.until_available(provider_id, drones=len(homes))


def warned_drones(system: Any, providers: set[str]) -> set[str]:
    """The drones of these providers that have raised an alarm about a low battery."""
    paths = [f"/v1/alarms?provider_id={provider_id}&limit=200" for provider_id in providers]
    alarms = [alarm for path in paths for alarm in system.operate("GET", path)["items"]]
    return {alarm["drone_id"] for alarm in alarms if alarm["code"] in _BATTERY}


def least_soc(system: Any, drone: dict[str, str]) -> float:
    """The lowest state of charge in the drone's telemetry."""
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/telemetry"
    rows = system.operate("GET", f"{path}?resolution=raw&limit=2000")["items"]
    assert rows
    return float(min(row["soc"] for row in rows))
