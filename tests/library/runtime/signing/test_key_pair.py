"""Signatures are Ed25519 over topic and payload, and no changed message verifies."""

import json

import pytest

from skyway.contracts.signature import payload_with, signed_bytes, split
from skyway.errors import InvalidInput
from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes

TOPIC = "skyway/v1/prv_1/drn_1/events"
PAYLOAD = b'{"seq":1,"note":"a \\"}"}'
KEY = PrivateKey(bytes(range(32)))
PUBLIC = public_key_bytes(KEY.public_key)


def test_a_signed_message_is_json_with_the_signature_as_its_last_member() -> None:
    signed = KEY.signed(TOPIC, PAYLOAD)

    members = json.loads(signed)
    assert [*members] == ["seq", "note", "signature"]
    assert members["note"] == json.loads(PAYLOAD)["note"]
    assert is_signed_by(PUBLIC, TOPIC, signed)


def test_the_signature_is_ed25519_of_domain_topic_and_head() -> None:
    """By another implementation."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    parts = split(KEY.signed(TOPIC, PAYLOAD))

    assert parts is not None
    assert parts.head == PAYLOAD[:-1]
    other = Ed25519PrivateKey.from_private_bytes(bytes(range(32)))
    assert parts.signature == other.sign(b"skyway-v1\n" + TOPIC.encode() + b"\n" + PAYLOAD[:-1])


def test_a_key_is_read_from_its_text() -> None:
    again = PrivateKey.read(KEY.text)

    assert again.public_key == KEY.public_key
    assert PrivateKey.new().text != PrivateKey.new().text


@pytest.mark.parametrize(
    ("topic", "change"),
    [
        ("skyway/v1/prv_1/drn_2/events", lambda signed: signed),
        ("skyway/v1/prv_1/drn_1/acks", lambda signed: signed),
        (TOPIC, lambda signed: signed.replace(b'"seq":1', b'"seq":2')),
        (TOPIC, lambda signed: signed + b" "),
        (TOPIC, lambda signed: signed[:-3] + b'A"}'),
        (TOPIC, lambda signed: signed[:-2] + b'","seq":2}'),
        (TOPIC, lambda _: PAYLOAD),
        (TOPIC, lambda _: b""),
        (TOPIC, lambda _: payload_with(PAYLOAD[:-1], b"\x00" * 64)),
        (TOPIC, lambda signed: b'{"x":1,' + signed[1:]),
    ],
    ids=["drone", "kind", "value", "space", "text", "member", "unsigned", "empty", "zero", "front"],
)
def test_a_changed_message_does_not_verify(topic: str, change: object) -> None:
    assert callable(change)
    assert not is_signed_by(PUBLIC, topic, change(KEY.signed(TOPIC, PAYLOAD)))


def test_the_key_of_another_drone_does_not_verify() -> None:
    signed = PrivateKey.new().signed(TOPIC, PAYLOAD)

    assert not is_signed_by(PUBLIC, TOPIC, signed)


@pytest.mark.parametrize(
    "text",
    ["", "short", "A" * 43, "*" * 43, KEY.public_key + "A", "AQ" + "A" * 41],
    ids=["empty", "short", "zero", "letters", "long", "small-order"],
)
def test_what_is_no_public_key_is_refused(text: str) -> None:
    with pytest.raises(InvalidInput, match="public_key"):
        public_key_bytes(text)


def test_a_private_key_is_not_shown_when_it_cannot_be_read() -> None:
    with pytest.raises(InvalidInput) as refused:
        PrivateKey.read("secret")

    assert "secret" not in str(refused.value)


def test_the_topic_cannot_run_into_the_payload() -> None:
    assert signed_bytes("a", b"b") == b"skyway-v1\na\nb"
