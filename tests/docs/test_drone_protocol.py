"""docs/reference/drone-protocol.md: its messages can be read, and it names what there is."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from skyway.contracts.drone_report import Ack, DroneEvent, DroneState
from skyway.contracts.instruction import Instruction, RefusalCode
from skyway.contracts.topics import CONNECTION, TOPICS
from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes

PAGE = (Path(__file__).parents[2] / "docs/reference/drone-protocol.md").read_text()
MISSION, ACK, EVENT, STATE = (
    json.loads(block) for block in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
)


@pytest.mark.parametrize(
    ("message", "form"),
    [(MISSION, Instruction), (ACK, Ack), (EVENT, DroneEvent), (STATE, DroneState)],
    ids=["instruction", "ack", "event", "state"],
)
def test_a_message_on_the_page_is_one_of_its_topic(message: dict[str, Any], form: Any) -> None:
    TypeAdapter(form).validate_json(json.dumps(message), extra="forbid")


def test_the_signed_example_on_the_page_verifies() -> None:
    (signed,) = re.findall(r"```text\n(.*?)\n```", PAGE, re.DOTALL)
    seed, public_key = re.findall(r"`([A-Za-z0-9_-]{43})`", PAGE)
    (name,) = re.findall(r"on the topic `(\S+)`:", PAGE)
    key = PrivateKey.read(seed)

    assert key.public_key == public_key
    assert is_signed_by(public_key_bytes(public_key), name, signed.encode())
    plain = re.sub(r',"signature":.*', "}", signed)
    assert key.signed(name, plain.encode()) == signed.encode()
    assert CONNECTION.ids_in(name) is not None
    assert CONNECTION.read(signed.encode()).status == "ONLINE"


def test_the_page_names_every_refusal_code() -> None:
    assert set(RefusalCode) == set(re.findall(r"^\| ([A-Z_]{5,}) \|", PAGE, re.MULTILINE)) - {
        "MISSION",
        "DIVERT",
        "RETURN_HOME",
        "RESUME",
        "HAND_OVER",
        "CANCEL",
        "REPORT",
        "STEP_ENDED",
        "STEP_FAILED",
        "MISSION_ENDED",
        "ALARM",
        "HAND_OVER_AWAITED",
        "PIN_ENTERED",
    }


def test_the_page_names_every_kind_of_instruction_step_and_event() -> None:
    schema = json.dumps(TypeAdapter(Instruction).json_schema())
    kinds = set(re.findall(r'"const": "([A-Z_]+)"', schema))
    events = DroneEvent.model_json_schema()["properties"]["event"]["enum"]

    assert {"MISSION", "DIVERT", "RECHARGE"} <= kinds
    assert not [name for name in (*kinds, *events) if name not in PAGE]


def test_the_table_of_topics_is_that_of_the_contracts() -> None:
    rows = re.findall(r"^\| `(skyway/v1/\S+)` \| (.+?) \| (\d) \| (yes|no) \|", PAGE, re.MULTILINE)

    expected = {
        (topic.template, str(topic.mqtt_qos), "yes" if topic.retained else "no")
        for topic in TOPICS
        if "drone" in (topic.writer, *topic.readers)
    }
    assert {(name, mqtt_qos, retained) for name, _, mqtt_qos, retained in rows} == expected
    assert all(
        direction.startswith("drone" if topic.writer == "drone" else "cloud")
        for name, direction, _, _ in rows
        for topic in TOPICS
        if topic.template == name
    )
