"""A broker in the wrong hands can neither steer a drone nor speak for it.

The attacker has the broker accounts of composition and of the drone, and has read every message: it
can publish everything that a broker could deliver.
"""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlsplit

import pytest
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from skyway.contracts.broker_rules import DEPLOYMENT_OPERATOR
from skyway.runtime.signing.key_pair import PrivateKey

pytestmark = [pytest.mark.end_to_end, pytest.mark.long, pytest.mark.fleet_rate(60.0)]

#: Further than all honest numbers.
FAR = 2**40


class Attacker:
    """Reads all messages of drones, and publishes in the name of others."""

    def __init__(self, system: Any, fleet: dict[str, Any]) -> None:
        (drone,) = fleet["drones"]
        self._system = system
        self._lock = threading.Lock()
        self._seen: list[tuple[str, bytes]] = []
        self.drone_id: str = drone["drone_id"]
        self.branch = f"skyway/v1/{drone['provider_id']}/{self.drone_id}"

    @property
    def seen(self) -> list[tuple[str, bytes]]:
        """Topics and payloads so far."""
        with self._lock:
            return [*self._seen]

    def note(self, message: MQTTMessage) -> None:
        if not message.topic.startswith("skyway/v1/customers"):
            with self._lock:
                self._seen.append((message.topic, bytes(message.payload)))

    def of_kind(self, kind: str) -> list[bytes]:
        return [payload for name, payload in self.seen if name == f"{self.branch}/{kind}"]

    @contextmanager
    def account(self, name: str, password: str, *, reads: bool = False) -> Iterator[Client]:
        address = urlsplit(self._system.keys["SKYWAY_MQTT_URL"])
        client = Client(CallbackAPIVersion.VERSION2, name, reconnect_on_failure=False)
        client.username_pw_set(name, password)
        client.on_message = lambda _client, _data, message: self.note(message)
        client.connect(address.hostname or "", address.port or 0)
        client.loop_start()
        self._system.eventually(client.is_connected, f"{name} connected")
        if reads:
            client.subscribe(f"{self.branch}/#", qos=1)
        yield client
        client.disconnect()
        client.loop_stop()

    def secret(self, name: str) -> str:
        return str((self._system.folder.secrets / name).read_text().strip())


def forged_reports(attacker: Attacker) -> list[tuple[str, bytes]]:
    """What would end or disturb the mission if it were believed."""
    event = json.loads(attacker.of_kind("events")[-1])
    state = json.loads(attacker.of_kind("state")[-1])
    for message in (event, state):
        message.pop("signature")
    now = datetime.now(UTC).isoformat()
    ended = event | {"seq": event["seq"] + 1, "step_id": 3, "step_kind": "DELIVER"}
    mission_over = event | {"seq": event["seq"] + 1, "event": "MISSION_ENDED", "step_id": None}
    far = state | {"session": FAR, "seq": FAR, "stream": FAR, "at": now}
    unknown = PrivateKey.new()
    forged: list[tuple[str, bytes]] = []
    for kind, message in (("events", ended), ("events", mission_over), ("state", far)):
        name, payload = f"{attacker.branch}/{kind}", json.dumps(message).encode()
        forged += [(name, payload), (name, unknown.signed(name, payload))]
    # Another signature of the drone, and true messages under another kind.
    tail = attacker.of_kind("events")[-1][-102:]
    forged.append((f"{attacker.branch}/events", json.dumps(ended).encode()[:-1] + tail))
    forged += [(f"{attacker.branch}/state", payload) for payload in attacker.of_kind("events")]
    return forged


def forged_instructions(attacker: Attacker) -> list[bytes]:
    """What would steer the drone if it were obeyed."""
    sent = json.loads(attacker.of_kind("instructions")[0])
    sent.pop("signature")
    cancel = {
        name: sent[name] for name in ("message_id", "sent_at", "mission_id", "expires_at", "stream")
    }
    cancel |= {"instruction_id": "ins_forged", "seq": sent["seq"] + 1, "mission_revision": 9}
    cancel |= {"kind": "HOLD", "reason": "forged"}
    name, payload = f"{attacker.branch}/instructions", json.dumps(cancel).encode()
    return [payload, PrivateKey.new().signed(name, payload), *attacker.of_kind("acks")]


@pytest.mark.storage_pair("embedded")
@pytest.mark.system_name("trouble")
def test_a_broker_that_forges_and_repeats_changes_nothing(system: Any) -> None:
    system.publish_corridor("broker")
    fleet = system.start_fleet(["broker-s1"])
    attacker = Attacker(system, fleet)
    operator, composition = attacker.secret("mqtt_operator"), attacker.secret("mqtt_composition")
    with (
        attacker.account(DEPLOYMENT_OPERATOR, operator, reads=True),
        attacker.account("composition", composition) as cloud,
    ):
        delivery_id = system.request_delivery(["broker-s3"], pickup="broker-s1")
        system.eventually(lambda: attacker.of_kind("events"), "the first event")
        for payload in forged_instructions(attacker):
            cloud.publish(f"{attacker.branch}/instructions", payload, qos=1).wait_for_publish()
        clock = {"fleet_at": "2030-01-01T00:00:00Z", "wall_at": "2020-01-01T00:00:00Z", "rate": 9}
        forged_clock = clock | {"message_id": "m", "sent_at": "2030-01-01T00:00:00Z"}
        with attacker.account("gateway", attacker.secret("mqtt_gateway")) as gateway:
            gateway.publish("skyway/v1/clock", json.dumps(forged_clock).encode(), qos=1)
            system.eventually(lambda: len(attacker.of_kind("events")) > 1, "the next event")
        reports = forged_reports(attacker)
        drone = fleet["drones"][0]
        ended = system.until_ended(delivery_id)
        system.stop_fleets()
        # The drone is away, and its account is the attacker's: all that it has said comes again.
        with attacker.account(drone["mqtt"]["user_name"], drone["mqtt"]["password"]) as voice:
            for name, payload in [*reports, *attacker.seen]:
                if not name.endswith("instructions"):
                    voice.publish(name, payload, qos=1).wait_for_publish()
        alarms = system.eventually(lambda: _alarms(system, attacker), "an alarm")

    assert ended["state"] == "COMPLETED"
    assert {alarm["code"] for alarm in alarms} == {"FORGED_MESSAGES"}, alarms
    kept = system.operate("GET", "/v1/quarantine?limit=200")["items"]
    assert {each["reason"] for each in kept} == {"FORGED"}
    assert "ins_forged" not in json.dumps([each.decode() for each in attacker.of_kind("acks")])
    assert system.delivery(delivery_id)["state"] == "COMPLETED"
    assert system.broken_rules() == []


def _alarms(system: Any, attacker: Attacker) -> list[Any]:
    items: list[Any] = system.operate("GET", "/v1/alarms?limit=200")["items"]
    return [each for each in items if each.get("drone_id") == attacker.drone_id]
