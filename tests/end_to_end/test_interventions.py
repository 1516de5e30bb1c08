"""People intervene in missions: hold, divert, confirm the loading, cancel."""

from typing import Any

import pytest

from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("postgresql-mosquitto"),
]

NAMES = ("held", "sent", "kept", "back")


def test_drones_obey_operators_loaders_and_customers(system: Any) -> None:
    system.operate("PUT", "/v1/networks/interventions", ladders(*NAMES))
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)
    system.start_fleet(["held-s1", "sent-s1", "back-s1"], model_id="quick-charge")
    system.start_fleet(["kept-s1"], model_id="quick-charge", loading="CONFIRMED")
    deliveries = {
        name: system.request_delivery([f"{name}-s5"], pickup=f"{name}-s1") for name in NAMES
    }

    _load(system, deliveries["kept"])
    # Each command is sent as soon as the drone is in the air: a fleet minute passes in a second.
    held = _flying(system, deliveries["held"])
    _command(system, held, "HOLD")
    sent = _flying(system, deliveries["sent"])
    _command(system, sent, "DIVERT", station_id="sent-t3")
    _flying(system, deliveries["back"])
    _cancel(system, deliveries["back"])
    _until_held(system, held)
    _until_waiting(system, sent, at="sent-t3")
    for mission_id in (held, sent):
        _command(system, mission_id, "RESUME")

    for name in ("held", "sent", "kept"):
        system.until_state(deliveries[name], "COMPLETED")
    cancelled = system.until_state(deliveries["back"], "CANCELLED")
    assert [each["state"] for each in cancelled["packages"]] == ["RETURNED"]


def _mission_of(system: Any, delivery_id: str) -> Any:
    missions = system.delivery(delivery_id)["missions"]
    return missions and system.operate("GET", f"/v1/missions/{missions[0]['mission_id']}")


def _flying(system: Any, delivery_id: str) -> str:
    """The delivery's mission, when its drone is in the air with the packages."""

    def seen() -> str | None:
        shown = _mission_of(system, delivery_id)
        state = shown and shown["drone_state"]
        is_flying = state and state["activity"] == "FLYING" and state["package_ids"]
        return shown["mission"]["mission_id"] if is_flying else None

    found: str = system.eventually(seen, f"{delivery_id} in the air")
    return found


def _load(system: Any, delivery_id: str) -> None:
    """Confirm the agreed packages when the drone waits for its loading."""

    def seen() -> Any:
        shown = _mission_of(system, delivery_id)
        state = shown and shown["drone_state"]
        return shown if state and state["activity"] == "LOADING" else None

    shown = system.eventually(seen, f"{delivery_id} being loaded")
    awaited = system.operate("GET", "/v1/missions?loading=AWAITED")["items"]
    mission_id = shown["mission"]["mission_id"]
    assert [each["mission_id"] for each in awaited] == [mission_id]
    packages = [
        {"package_id": each["package_id"], "mass_kg": each["mass_kg"]}
        for each in shown["steps"][0]["step"]["packages"]
    ]
    answer = system.operate("POST", f"/v1/missions/{mission_id}/loading", {"packages": packages})
    assert answer["outcome"] == "CONFIRMED"


def _command(system: Any, mission_id: str, command: str, **members: str) -> None:
    body = {"command": command, "reason": "a crowd below", **members}
    system.operate("POST", f"/v1/missions/{mission_id}/commands", body)


def _cancel(system: Any, delivery_id: str) -> None:
    answer = system.call(
        "POST",
        f"/v1/deliveries/{delivery_id}/cancel",
        key=system.keys["SKYWAY_CUSTOMER_KEY"],
        body={"reason": "bought elsewhere"},
    )
    assert answer.status_code == 200, answer.text


def _until_held(system: Any, mission_id: str) -> None:
    def seen() -> bool:
        state = system.operate("GET", f"/v1/missions/{mission_id}")["drone_state"]
        return state["is_held"] and state["station_id"] is not None

    system.eventually(seen, f"{mission_id} held")


def _until_waiting(system: Any, mission_id: str, *, at: str) -> None:
    def seen() -> bool:
        shown = system.operate("GET", f"/v1/missions/{mission_id}")
        state = shown["drone_state"]
        stands = (state["station_id"], state["activity"]) == (at, "WAITING")
        return stands and shown["mission"]["is_held"]

    system.eventually(seen, f"{mission_id} waiting at {at}")
