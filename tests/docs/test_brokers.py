"""docs/reference/brokers.md names the limits that the embedded broker has."""

import re
from pathlib import Path

from skyway_broker.limits import AccountLimits, Limits

from skyway.broker_setup import mosquitto

PAGE = (Path(__file__).parents[2] / "docs/reference/brokers.md").read_text()
#: What a cell's unit is worth.
UNITS = {"": 1, "KiB": 1 << 10, "MiB": 1 << 20}


def rows(first_cell: str) -> list[list[str]]:
    """The cells of the rows whose first cell begins like this."""
    lines = [line.strip("| ").split("|") for line in PAGE.splitlines() if line.startswith("| ")]
    found = [[cell.strip() for cell in line] for line in lines]
    return [line for line in found if line[0].startswith(first_cell)]


def numbers(text: str) -> list[int]:
    """The quantities of a cell, in bytes or as they are."""
    return [int(number) * UNITS[unit] for number, unit in re.findall(r"(\d+) ?([KM]iB|)", text)]


def test_the_limits_of_an_account_are_on_the_page() -> None:
    def column(limits: AccountLimits) -> list[float]:
        return [
            limits.packets.per_s,
            limits.packets.burst,
            limits.connects.per_s,
            limits.connects.burst,
            limits.connections,
            limits.waiting_bytes,
            limits.filters,
            limits.retained,
            limits.retained_bytes,
        ]

    table = rows("")
    first = next(n for n, row in enumerate(table) if row[0] == "packets a second")
    shown = table[first : first + 9]

    limits = Limits()
    assert [numbers(row[1]) for row in shown] == [[value] for value in column(limits.client)]
    assert [numbers(row[2]) for row in shown] == [[value] for value in column(limits.service)]


def test_the_limits_of_mosquitto_are_on_the_page() -> None:
    expected = {
        "`max_packet_size`": [mosquitto.PACKET_BYTES],
        "`max_connections` of": [mosquitto.CLIENT_CONNECTIONS, mosquitto.SERVICE_CONNECTIONS],
        "`max_inflight_messages`": [mosquitto.INFLIGHT_MESSAGES, mosquitto.INFLIGHT_BYTES],
        "`max_queued_messages`": [mosquitto.QUEUED_MESSAGES, mosquitto.QUEUED_BYTES],
    }

    assert {name: numbers(rows(name)[0][1]) for name in expected} == expected


def test_the_limits_of_the_broker_are_on_the_page() -> None:
    limits = Limits()
    expected = {
        "connections in all": [limits.connections],
        "connections of one address": [limits.connections_per_address],
        "connections a second of one address": [limits.connects_per_address.per_s],
        "connections at any moment of one address": [limits.connects_per_address.burst],
        "a CONNECT": [limits.connect_bytes, limits.introduction_s],
        "a PUBLISH": [limits.publish_bytes],
        "any other packet": [limits.packet_bytes],
        "a packet that has begun": [limits.packet_s],
        "an unread answer": [limits.unread_s],
        "a topic or a filter": [limits.topic_characters, limits.topic_levels],
        "bytes that wait for all": [limits.waiting_bytes],
    }

    assert {name: numbers(rows(name)[0][1]) for name in expected} == expected
    assert f"at most {limits.silence_s:g} s" in rows("silence")[0][1]
