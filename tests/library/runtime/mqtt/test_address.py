"""Broker URLs."""

import asyncio
import socket

import pytest

from skyway.errors import InvalidInput
from skyway.runtime.mqtt.address import BrokerAddress


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("mqtt://broker:1900", BrokerAddress("broker", 1900, is_encrypted=False)),
        ("mqtt://broker", BrokerAddress("broker", 1883, is_encrypted=False)),
        ("mqtts://broker", BrokerAddress("broker", 8883, is_encrypted=True)),
        ("mqtt+nats://node:1900", BrokerAddress("node", 1900, is_encrypted=False, most_qos=0)),
        ("mqtts+nats://node", BrokerAddress("node", 8883, is_encrypted=True, most_qos=0)),
        ("mqtt://[::1]:1900", BrokerAddress("::1", 1900, is_encrypted=False)),
    ],
)
def test_a_url_names_host_port_and_encryption(url, expected):
    assert BrokerAddress.parse(url) == expected


def test_the_nodes_of_a_cluster_are_parted_by_commas():
    addresses = BrokerAddress.parse_all("mqtt+nats://a:1, mqtt+nats://b:2")

    assert [(each.host, each.port) for each in addresses] == [("a", 1), ("b", 2)]
    with pytest.raises(InvalidInput, match="mqtt_url"):
        BrokerAddress.parse_all("mqtt://a,")


@pytest.mark.parametrize("url", ["", "broker:1883", "http://broker", "mqtt://", "nats://a"])
def test_an_invalid_broker_url_is_refused(url):
    with pytest.raises(InvalidInput, match="mqtt_url"):
        BrokerAddress.parse(url)


async def test_a_socket_sends_small_packets_immediately():
    server = await asyncio.start_server(lambda _r, writer: writer.close(), "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]

    async with server:
        sock = await BrokerAddress("127.0.0.1", port, is_encrypted=False).open_socket()

    assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0
    sock.close()
