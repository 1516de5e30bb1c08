"""A drone and a customer that are admitted but hostile harm nobody else."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlsplit

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

pytestmark = pytest.mark.end_to_end

MOST = 2**53 - 1

#: Unreadable messages, more than enough to be put out.
FLOOD = 1_000


@pytest.mark.storage_pair("embedded")
def test_a_hostile_drone_and_a_hostile_customer_harm_nobody(system: Any) -> None:
    system.publish_corridor("hostile")
    system.start_fleet(["hostile-s1"], name="Honest Air")
    rogue = _registered(system)
    state = f"skyway/v1/{rogue['provider_id']}/{rogue['drone_id']}/state"
    customer = system.operate("POST", "/v1/keys", {"role": "customer", "subject_id": "hostile-s1"})[
        "mqtt"
    ]

    with _logged_in(system, **rogue["mqtt"]) as client:
        client.publish(state, _state(session=MOST, seq=MOST, stream=MOST), qos=1).wait_for_publish()
        # A drone that is slowed by the flood has nothing more kept.
        system.eventually(lambda: _kept(system, rogue), "the state in the quarantine")
        for number in range(FLOOD):
            client.publish(state, b"{%d" % number * 500, qos=1)
        delivery_id = system.request_delivery(["hostile-s2"], pickup="hostile-s1")
        with _logged_in(system, **customer) as namesake:
            namesake.publish("skyway/v1/stations/hostile-s1/state", b"{}", qos=1, retain=True)
        ended = system.until_ended(delivery_id)
        alarm = system.eventually(lambda: _alarms(system, rogue), "an alarm")[0]

    assert ended["state"] == "COMPLETED"
    assert (alarm["code"], alarm["level"]) == ("SENDER_PUT_OUT", "URGENT")
    kept = _kept(system, rogue)
    assert 1 <= len(kept) <= 20
    printed = system.command("quarantine")
    assert rogue["drone_id"] in printed.stdout
    assert {each["reason"] for each in kept} == {"UNREADABLE", "IMPLAUSIBLE"}
    for each in kept:
        _is_not_replayed(system, each["quarantine_id"])
    assert _kept(system, rogue) == kept
    assert system.broken_rules() == []


@pytest.mark.storage_pair("postgresql-mosquitto")
@pytest.mark.long
def test_the_drone_is_believed_again_after_a_theft(system: Any) -> None:
    system.publish_corridor("theft")
    drone = _registered(system, home="theft-s1")
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    topic = f"skyway/v1/{drone['provider_id']}/{drone['drone_id']}"
    with _logged_in(system, **drone["mqtt"]) as thief:
        thief.publish(f"{topic}/connection", _connection(MOST), qos=1, retain=True)
        thief.publish(f"{topic}/state", _state(session=MOST, seq=MOST), qos=1, retain=True)
        system.eventually(lambda: system.operate("GET", path)["activity"] == "IDLE", "the thief")
        system.operate("DELETE", f"{path}/credentials")
    token = system.operate("POST", f"{path}/enrolment-tokens", {})["enrolment_token"]
    enrolled = system.operate("POST", "/v1/enrolments", {"enrolment_token": token})

    with _logged_in(system, **enrolled["mqtt"]) as client:

        def is_shown() -> bool:
            client.publish(f"{topic}/connection", _connection(8), qos=1, retain=True)
            state = _state(session=8, seq=1, activity="WAITING")
            client.publish(f"{topic}/state", state, qos=1, retain=True)
            shown = system.operate("GET", path)
            return bool(shown["activity"] == "WAITING" and shown["state"] == "AVAILABLE")

        system.eventually(is_shown, "the drone is believed")


def _registered(system: Any, *, home: str = "hostile-s1") -> dict[str, Any]:
    """A drone of a provider of its own; no agent runs for it."""
    provider = system.operate(
        "POST", "/v1/providers", {"name": "Rogue Air", "tariff": {"base": 100}}
    )
    path = f"/v1/providers/{provider['provider_id']}/drones"
    drone: dict[str, Any] = system.operate(
        "POST", path, {"model_id": "paper-scenario", "home_station_id": home}
    )
    return drone


@contextmanager
def _logged_in(system: Any, *, user_name: str, password: str) -> Iterator[Client]:
    address = urlsplit(system.keys["SKYWAY_MQTT_URL"])
    client = Client(CallbackAPIVersion.VERSION2, user_name, reconnect_on_failure=False)
    client.username_pw_set(user_name, password)
    client.connect(address.hostname or "", address.port or 0)
    client.loop_start()
    system.eventually(client.is_connected, f"{user_name} connected")
    yield client
    client.disconnect()
    client.loop_stop()


def _state(*, session: int, seq: int, stream: int = 0, activity: str = "IDLE") -> bytes:
    now = datetime.now(UTC).isoformat()
    message = {
        "message_id": "m",
        "sent_at": now,
        "session": session,
        "seq": seq,
        "at": now,
        "activity": activity,
        "stream": stream,
        "last_instruction_seq": 0,
        "last_event_seq": 0,
        "station_id": None,
        "position": [-97.9, 29.5],
        "soc": 0.9,
    }
    return json.dumps(message).encode()


def _connection(session: int) -> bytes:
    message = {
        "message_id": "m",
        "sent_at": datetime.now(UTC).isoformat(),
        "session": session,
        "connection_number": session,
        "status": "ONLINE",
    }
    return json.dumps(message).encode()


def _alarms(system: Any, rogue: dict[str, Any]) -> list[dict[str, Any]]:
    path = f"/v1/alarms?provider_id={rogue['provider_id']}"
    alarms: list[dict[str, Any]] = system.operate("GET", path)["items"]
    return alarms


def _kept(system: Any, rogue: dict[str, Any]) -> list[dict[str, Any]]:
    """The set-aside messages of a provider's drones."""
    path = f"/v1/quarantine?provider_id={rogue['provider_id']}&limit=200"
    kept: list[dict[str, Any]] = system.operate("GET", path)["items"]
    return kept


def _is_not_replayed(system: Any, quarantine_id: str) -> None:
    """The message is not taken by a replay, and a customer may not even ask."""
    path = f"/v1/quarantine/{quarantine_id}/replay"
    keys = system.keys
    answers = [
        system.call("POST", path, key=keys[f"SKYWAY_{role}_KEY"]).status_code
        for role in ("OPERATOR", "CUSTOMER")
    ]
    assert answers == [409, 403]
