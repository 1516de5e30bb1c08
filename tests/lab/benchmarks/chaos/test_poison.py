"""The messages that no drone would send."""

import random
from itertools import islice

import pytest
from pydantic import ValidationError
from skyway_lab.benchmarks.chaos.faults.poison import extreme_payloads
from skyway_lab.benchmarks.fleet.crew import crew_of
from skyway_lab.benchmarks.hostile.extremes import UNREADABLE

from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, TELEMETRY

TOPICS = (ACKS, EVENTS, STATE, TELEMETRY, CONNECTION)


@pytest.mark.parametrize("payload", UNREADABLE, ids=lambda payload: repr(payload[:20]))
def test_no_topic_reads_an_unreadable_message(payload: bytes) -> None:
    for topic in TOPICS:
        with pytest.raises(ValidationError):
            topic.read(payload)


def is_readable(payload: bytes) -> bool:
    for topic in TOPICS:
        try:
            topic.read(payload)
        except ValidationError:
            continue
        return True
    return False


def test_some_extreme_messages_are_readable_and_some_are_not() -> None:
    [rogue] = crew_of(1, seed=1)

    payloads = list(islice(extreme_payloads(rogue, random.Random(1), missions=()), 200))

    assert 20 < sum(map(is_readable, payloads)) < 180


def test_some_messages_are_about_missions_of_other_drones() -> None:
    [rogue] = crew_of(1, seed=1)

    payloads = islice(extreme_payloads(rogue, random.Random(1), missions=["msn_other"]), 100)

    assert any(b'"mission_id": "msn_other"' in payload for payload in payloads)
