"""A drone obeys what the cloud has signed for it, and nothing else."""

import logging

import pytest

from skyway.contracts.topics import CLOCK, DELIVERY_EVENTS, INSTRUCTIONS, NETWORK_VERSION, STATE
from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes
from skyway.runtime.signing.seal import CloudSeal, DroneSeal, NoSeal
from tests.signing_files import PUBLIC_KEYS, SIGNING_KEYS

MINE = INSTRUCTIONS("prv_1", "drn_1").name
PAYLOAD = b'{"kind":"HOLD"}'
COMPOSITION = CloudSeal(SIGNING_KEYS["composition"])
GATEWAY = CloudSeal(SIGNING_KEYS["gateway"])


def drone_seal() -> DroneSeal:
    return DroneSeal(PrivateKey(b"d" * 32), PUBLIC_KEYS)


def test_a_drone_obeys_what_composition_has_signed_for_it() -> None:
    signed = COMPOSITION.sealed(MINE, PAYLOAD)

    assert drone_seal().admits(MINE, signed)


@pytest.mark.parametrize(
    ("name", "payload"),
    [
        (MINE, PAYLOAD),
        (MINE, GATEWAY.sealed(MINE, PAYLOAD)),
        (MINE, PrivateKey.new().signed(MINE, PAYLOAD)),
        (MINE, COMPOSITION.sealed(INSTRUCTIONS("prv_1", "drn_2").name, PAYLOAD)),
        (MINE, COMPOSITION.sealed(MINE, PAYLOAD).replace(b"HOLD", b"SOLD")),
        (CLOCK().name, b'{"rate":2.0}'),
        (CLOCK().name, COMPOSITION.sealed(CLOCK().name, b'{"rate":2.0}')),
        (NETWORK_VERSION("n").name, b'{"version":2}'),
        ("skyway/v1/unknown", COMPOSITION.sealed(MINE, PAYLOAD)),
    ],
    ids=[
        "stripped",
        "of another service",
        "by another key",
        "for another drone",
        "changed",
        "clock",
        "clock of another service",
        "network",
        "unknown topic",
    ],
)
def test_a_drone_ignores_everything_else(name: str, payload: bytes) -> None:
    seal = drone_seal()

    assert not seal.admits(name, payload)
    assert seal.refused == 1


def test_a_drone_believes_each_of_several_keys_while_one_is_replaced() -> None:
    coming = PrivateKey.new()
    keys = PUBLIC_KEYS.model_copy(
        update={"composition": (*PUBLIC_KEYS.composition, coming.public_key)}
    )
    seal = DroneSeal(None, keys)

    assert seal.admits(MINE, COMPOSITION.sealed(MINE, PAYLOAD))
    assert seal.admits(MINE, coming.signed(MINE, PAYLOAD))


def test_a_drone_that_knows_no_key_of_the_cloud_obeys_as_before() -> None:
    assert DroneSeal(None, None).admits(MINE, PAYLOAD)


def test_refusals_are_logged_once_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    seal = drone_seal()
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            assert not seal.admits(MINE, PAYLOAD)

    assert len(caplog.records) == 1
    assert seal.refused == 100


def test_a_drone_signs_all_that_it_says() -> None:
    key = PrivateKey(b"d" * 32)
    name = STATE("prv_1", "drn_1").name

    signed = DroneSeal(key, None).sealed(name, PAYLOAD)

    assert is_signed_by(public_key_bytes(key.public_key), name, signed)
    assert DroneSeal(None, PUBLIC_KEYS).sealed(name, PAYLOAD) == PAYLOAD


def test_a_service_signs_only_what_drones_may_read() -> None:
    name = DELIVERY_EVENTS("c", "d").name

    assert GATEWAY.sealed(name, PAYLOAD) == PAYLOAD
    assert GATEWAY.sealed(CLOCK().name, PAYLOAD) != PAYLOAD


def test_a_client_without_a_seal_changes_nothing() -> None:
    assert NoSeal().sealed(MINE, PAYLOAD) == PAYLOAD
    assert NoSeal().admits(MINE, PAYLOAD)
