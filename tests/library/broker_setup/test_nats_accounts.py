"""The accounts of NATS as the registry writes them."""

import json
import logging
from pathlib import Path
from typing import Any

import bcrypt
import pytest

from skyway.broker_setup.nats_accounts import (
    NatsAccounts,
    hash_for_nats,
    is_nats_hash,
    nats_accounts,
)
from skyway.broker_setup.passwords import hash_password
from skyway.contracts.broker_rules import BrokerRules
from skyway.errors import InvalidInput

HASH = hash_for_nats("secret")


def users(text: str) -> dict[str, Any]:
    """The users in the file, by name."""
    found = json.loads("{" + text + "}")["accounts"]["SKYWAY"]["users"]
    return {user["user"]: user for user in found if user["user"] != "."}


def test_a_drone_writes_and_reads_its_own_subjects() -> None:
    drone = users(nats_accounts({"p/d": HASH}, BrokerRules()))["p/d"]

    assert drone["password"] == HASH
    assert drone["allowed_connection_types"] == ["MQTT"]
    assert "skyway.v1.p.d.acks" in drone["permissions"]["publish"]["allow"]
    assert "skyway.v1.p.d.instructions" in drone["permissions"]["subscribe"]["allow"]
    everything = json.dumps(drone["permissions"])
    assert ">" not in everything
    assert "%u" not in everything


@pytest.mark.parametrize("name", ["customer", "operator/olga"])
def test_people_write_nothing(name: str) -> None:
    user = users(nats_accounts({name: HASH}, BrokerRules()))[name]

    assert user["permissions"]["publish"] == {"deny": ">"}


def test_a_service_is_no_customer_of_its_name() -> None:
    user = users(nats_accounts({"gateway": HASH}, BrokerRules()))["gateway"]

    assert "customers.gateway" not in json.dumps(user["permissions"])


@pytest.mark.parametrize("name", ["*", "a.b", 'a"b', "a/b/c", "", "a b"])
def test_a_name_that_is_no_identifier_is_refused(name: str) -> None:
    with pytest.raises(InvalidInput, match="user_name"):
        nats_accounts({name: HASH}, BrokerRules())


def test_accounts_of_another_broker_are_left_out_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    accounts = NatsAccounts(tmp_path / "accounts")

    with caplog.at_level(logging.WARNING):
        accounts.write({"p/old": hash_password("secret"), "p/new": HASH}, {"gateway": HASH})

    assert users(accounts.file.read_text()).keys() == {"p/new", "gateway"}
    assert accounts.file.stat().st_mode & 0o777 == 0o600
    assert [record.__dict__["accounts"] for record in caplog.records] == [1]


def test_without_accounts_nats_still_asks_for_a_password() -> None:
    [placeholder] = json.loads("{" + nats_accounts({}, BrokerRules()) + "}")["accounts"]["SKYWAY"][
        "users"
    ]

    assert is_nats_hash(placeholder["password"])
    assert placeholder["permissions"] == {"publish": {"deny": ">"}, "subscribe": {"deny": ">"}}


def test_a_hash_is_salted_and_checked_by_bcrypt() -> None:
    other = hash_for_nats("secret")

    assert other != HASH
    assert is_nats_hash(HASH)
    assert not is_nats_hash(hash_password("secret"))
    assert bcrypt.checkpw(b"secret", HASH.encode())


def test_a_password_that_bcrypt_would_cut_off_is_refused() -> None:
    with pytest.raises(InvalidInput, match="72"):
        hash_for_nats("x" * 73)
