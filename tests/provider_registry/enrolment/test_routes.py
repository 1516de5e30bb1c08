"""The gateway opens and closes customers' broker accounts, and no others."""

import itertools
from pathlib import Path
from typing import Any

import pytest
from skyway_provider_registry.enrolment import credential_store

from skyway.broker_setup.passwords import matches, read_password_file
from skyway.runtime.sql.database import Database

PASSWORD = "a password of thirty-two letters"
PATH = "/internal/broker-accounts"


async def test_a_customer_logs_in_with_the_last_password(api: Any, tmp_path: Path) -> None:
    await api(None, "PUT", f"{PATH}/newcomer", {"password": "an earlier password"})

    answer = await api(None, "PUT", f"{PATH}/newcomer", {"password": PASSWORD})

    assert answer.status_code == 204
    assert matches(PASSWORD, read_password_file(tmp_path / "passwords")["newcomer"])


async def test_a_removed_customer_cannot_log_in(api: Any, tmp_path: Path) -> None:
    await api(None, "PUT", f"{PATH}/newcomer", {"password": PASSWORD})

    first = await api(None, "DELETE", f"{PATH}/newcomer")
    again = await api(None, "DELETE", f"{PATH}/newcomer")

    assert (first.status_code, again.status_code) == (204, 204)
    assert "newcomer" not in read_password_file(tmp_path / "passwords")


async def test_an_operator_logs_in_until_the_account_is_closed(api: Any, tmp_path: Path) -> None:
    path = "/internal/operator-accounts/olga"
    await api(None, "PUT", path, {"password": PASSWORD})
    opened = read_password_file(tmp_path / "passwords")

    closed = await api(None, "DELETE", path)

    assert matches(PASSWORD, opened["operator/olga"])
    assert closed.status_code == 204
    assert "operator/olga" not in read_password_file(tmp_path / "passwords")


async def test_the_deployments_own_operator_cannot_be_changed(api: Any) -> None:
    path = "/internal/operator-accounts/deployment"

    put = await api(None, "PUT", path, {"password": PASSWORD})
    delete = await api(None, "DELETE", path)

    assert (put.status_code, delete.status_code) == (422, 422)


async def test_accounts_of_our_own_processes_cannot_be_changed(
    api: Any, subtests: pytest.Subtests
) -> None:
    names = ("gateway", "registry", "composition", "operator", "drn_000001", "a b", "x" * 65)
    for method, name in itertools.product(("PUT", "DELETE"), names):
        with subtests.test(f"{method} {name}"):
            body = {"password": PASSWORD} if method == "PUT" else None

            answer = await api(None, method, f"{PATH}/{name}", body)

            assert answer.status_code == 422
            assert answer.json()["errors"][0]["field"] == "user_name"


async def test_an_account_gets_no_password_for_another_kind_of_account(db: Database) -> None:
    async with db.write() as tx:
        await credential_store.put_person(tx, "CUSTOMER", "carol", password_hash="first")
        await credential_store.put_person(tx, "OPERATOR", "carol", password_hash="second")
        hashes = await credential_store.every_hash(tx.connection)

    assert hashes["carol"] == "first"


@pytest.mark.parametrize("caller", ["customer:newcomer", "operator:op", "provider:prv_1"])
async def test_only_services_write_accounts(api: Any, caller: str) -> None:
    put = await api(caller, "PUT", f"{PATH}/newcomer", {"password": PASSWORD})
    delete = await api(caller, "DELETE", f"{PATH}/newcomer")

    assert (put.status_code, delete.status_code) == (403, 403)


@pytest.mark.parametrize("body", [{}, {"password": "short"}, {"password": "x" * 201}])
async def test_a_bad_password_is_refused_by_its_field(api: Any, body: dict[str, str]) -> None:
    answer = await api(None, "PUT", f"{PATH}/newcomer", body)

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "password"
