"""A token is exchanged once, for credentials that replace the earlier ones."""

import hashlib
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from skyway_verifier.registry.rules import RULES

from skyway.broker_setup.passwords import matches
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.provider_registry.broker_accounts import accounts_in

pytestmark = pytest.mark.databases("sqlite")

GATEWAY = "service:gateway"
MONTH = timedelta(days=30)


async def enrol(api: Any, token: str, key: str | None = None) -> Any:
    return await api(GATEWAY, "POST", "/v1/enrolments", {"enrolment_token": token}, key)


async def whose(api: Any, key: str) -> Any:
    body = {"key_hash": hashlib.sha256(key.encode()).hexdigest()}
    answer = await api(None, "POST", "/internal/drone-keys", body)
    assert answer.status_code == 200, answer.text
    return answer.json()["drone_id"]


def logs_in(folder: Path, drone_id: str, password: str) -> bool:
    hashed = accounts_in(folder).get(drone_id)
    return hashed is not None and matches(password, hashed)


async def test_a_token_is_exchanged_for_everything_a_drone_needs(api: Any, tmp_path: Path) -> None:
    drone = await api.drone(await api.provider(), soc=0.8)

    answer = await enrol(api, drone["enrolment_token"])

    enrolled = answer.json()
    assert answer.status_code == 201
    assert answer.headers["cache-control"] == "no-store"
    for member in ("drone_id", "provider_id", "model", "home_station_id", "home_position", "soc"):
        assert enrolled[member] == drone[member]
    assert enrolled["mqtt_urls"] == ["mqtt://one:1883", "mqtt://two:1883"]
    assert enrolled["mqtt"]["user_name"] == f"{drone['provider_id']}/{drone['drone_id']}"
    assert logs_in(tmp_path, drone["drone_id"], enrolled["mqtt"]["password"])
    assert await whose(api, enrolled["key"]) == drone["drone_id"]


async def test_the_password_of_the_registration_works_until_the_drone_enrols(
    api: Any, tmp_path: Path
) -> None:
    drone = await api.drone(await api.provider())
    before = logs_in(tmp_path, drone["drone_id"], drone["mqtt"]["password"])

    await enrol(api, drone["enrolment_token"])

    after = logs_in(tmp_path, drone["drone_id"], drone["mqtt"]["password"])
    assert (before, after) == (True, False)


async def test_a_token_works_once(api: Any, tmp_path: Path) -> None:
    drone = await api.drone(await api.provider())
    first = (await enrol(api, drone["enrolment_token"])).json()

    again = await enrol(api, drone["enrolment_token"], "a key of its own")

    assert again.status_code == 409
    assert again.json()["code"] == "TOKEN_USED"
    assert logs_in(tmp_path, drone["drone_id"], first["mqtt"]["password"])


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_lost_answer_is_repeated_for_the_same_key(api: Any, tmp_path: Path) -> None:
    drone = await api.drone(await api.provider())
    lost = await enrol(api, drone["enrolment_token"], "made up before asking")

    again = await enrol(api, drone["enrolment_token"], "made up before asking")

    assert again.json() == lost.json()
    assert logs_in(tmp_path, drone["drone_id"], again.json()["mqtt"]["password"])


async def test_a_token_lasts_a_month(api: Any, clock: ManualClock) -> None:
    provider_id = await api.provider()
    old, older = await api.drone(provider_id), await api.drone(provider_id)

    clock.advance(MONTH - timedelta(seconds=1))
    in_time = await enrol(api, old["enrolment_token"])
    clock.advance(timedelta(seconds=1))
    late = await enrol(api, older["enrolment_token"])

    assert in_time.status_code == 201
    assert (late.status_code, late.json()["code"]) == (409, "TOKEN_EXPIRED")


@pytest.mark.parametrize("token", ["enr_made-up", "x", "x" * 201, ""])
async def test_an_invented_token_is_refused_and_not_repeated(api: Any, token: str) -> None:
    await api.drone(await api.provider())

    answer = await enrol(api, token)

    assert answer.status_code in {403, 422}
    assert "made-up" not in answer.text


@pytest.mark.parametrize("caller", ["provider:prv_1", "operator:op", "customer:c", "drone:drn_1"])
async def test_only_the_gateway_exchanges_tokens(api: Any, caller: str) -> None:
    body = {"enrolment_token": "enr_x"}

    answer = await api(caller, "POST", "/v1/enrolments", body)

    assert answer.status_code == 403


async def test_a_new_token_replaces_the_old_one_and_nothing_else(api: Any, tmp_path: Path) -> None:
    provider_id = await api.provider()
    drone = await api.drone(provider_id)
    path = f"/v1/providers/{provider_id}/drones/{drone['drone_id']}/enrolment-tokens"

    made = await api(f"provider:{provider_id}", "POST", path)

    assert made.status_code == 201
    assert logs_in(tmp_path, drone["drone_id"], drone["mqtt"]["password"])
    assert (await enrol(api, drone["enrolment_token"])).status_code == 403
    assert (await enrol(api, made.json()["enrolment_token"])).status_code == 201


async def test_another_provider_cannot_make_tokens_or_revoke(api: Any, tmp_path: Path) -> None:
    provider_id, other_provider = await api.provider(), await api.provider()
    drone = await api.drone(provider_id)
    own = f"/v1/providers/{provider_id}/drones/{drone['drone_id']}"
    foreign = f"/v1/providers/{other_provider}/drones/{drone['drone_id']}"

    answers = [
        await api(f"provider:{other_provider}", method, f"{path}/{what}")
        for path in (own, foreign)
        for method, what in (("POST", "enrolment-tokens"), ("DELETE", "credentials"))
    ]

    assert [answer.status_code for answer in answers] == [404] * 4
    assert logs_in(tmp_path, drone["drone_id"], drone["mqtt"]["password"])


@pytest.mark.databases("sqlite", "postgresql")
async def test_no_secret_is_stored(api: Any, db: Database) -> None:
    drone = await api.drone(await api.provider())
    enrolled = (await enrol(api, drone["enrolment_token"], "key")).json()

    async with db.read() as connection:
        kept = await connection.run_sync(_everything)

    for secret in (drone["enrolment_token"], enrolled["key"], enrolled["mqtt"]["password"]):
        assert secret not in kept
    assert await broken_rules(db, RULES) == []


def _everything(connection: Any) -> str:
    from skyway_provider_registry.tables import metadata

    return "".join(
        repr(row) for table in metadata.sorted_tables for row in connection.execute(table.select())
    )
