"""A rotation never leaves a drone without credentials; a revocation always does."""

import hashlib
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.tables import presence
from skyway_verifier.registry.rules import RULES
from sqlalchemy import update

from skyway.broker_setup.certificates import CLIENT_LIFE
from skyway.broker_setup.passwords import matches
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.provider_registry.broker_accounts import accounts_in

GATEWAY = "service:gateway"
ROTATIONS = "/v1/enrolments/rotations"


async def whose(api: Any, key: str) -> Any:
    body = {"key_hash": hashlib.sha256(key.encode()).hexdigest()}
    answer = await api(None, "POST", "/internal/drone-keys", body)
    assert answer.status_code == 200, answer.text
    return answer.json()["drone_id"]


def logs_in(folder: Path, drone_id: str, password: str) -> bool:
    hashed = accounts_in(folder).get(drone_id)
    return hashed is not None and matches(password, hashed)


@pytest.fixture
async def enrolled(api: Any) -> Any:
    drone = await api.drone(await api.provider())
    body = {"enrolment_token": drone["enrolment_token"]}
    return (await api(GATEWAY, "POST", "/v1/enrolments", body)).json()


async def rotate(api: Any, drone_id: str) -> Any:
    answer = await api(f"drone:{drone_id}", "POST", ROTATIONS)
    assert answer.status_code == 201, answer.text
    return answer.json()


async def test_the_old_credentials_work_until_the_new_key_is_used(
    api: Any, enrolled: Any, tmp_path: Path
) -> None:
    drone_id = enrolled["drone_id"]

    following = await rotate(api, drone_id)

    assert await whose(api, enrolled["key"]) == drone_id
    assert logs_in(tmp_path, drone_id, enrolled["mqtt"]["password"])
    assert not logs_in(tmp_path, drone_id, following["mqtt"]["password"])


async def test_the_first_use_of_the_new_key_ends_the_old_credentials(
    api: Any, enrolled: Any, tmp_path: Path
) -> None:
    drone_id = enrolled["drone_id"]
    following = await rotate(api, drone_id)

    used = [await whose(api, following["key"]) for _ in range(2)]

    assert used == [drone_id] * 2
    assert await whose(api, enrolled["key"]) is None
    assert not logs_in(tmp_path, drone_id, enrolled["mqtt"]["password"])
    assert logs_in(tmp_path, drone_id, following["mqtt"]["password"])


async def test_a_rotation_whose_answer_was_lost_can_be_repeated(
    api: Any, enrolled: Any, tmp_path: Path
) -> None:
    drone_id = enrolled["drone_id"]
    lost = await rotate(api, drone_id)

    following = await rotate(api, drone_id)

    assert await whose(api, lost["key"]) is None
    assert await whose(api, following["key"]) == drone_id
    assert logs_in(tmp_path, drone_id, following["mqtt"]["password"])


async def test_an_enrolment_cancels_a_rotation(api: Any, enrolled: Any) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    following = await rotate(api, drone_id)
    path = f"/v1/providers/{provider_id}/drones/{drone_id}/enrolment-tokens"
    token = (await api(f"provider:{provider_id}", "POST", path)).json()["enrolment_token"]

    again = (await api(GATEWAY, "POST", "/v1/enrolments", {"enrolment_token": token})).json()

    known = [await whose(api, one["key"]) for one in (enrolled, following, again)]
    assert known == [None, None, drone_id]


@pytest.mark.parametrize("caller", ["provider:prv_1", "operator:op", "customer:c", GATEWAY])
async def test_only_a_drone_rotates_credentials(api: Any, caller: str) -> None:
    assert (await api(caller, "POST", ROTATIONS)).status_code == 403


async def test_a_drone_that_never_enrolled_has_nothing_to_rotate(api: Any) -> None:
    drone = await api.drone(await api.provider())

    answer = await api(f"drone:{drone['drone_id']}", "POST", ROTATIONS)

    assert answer.status_code == 403


async def test_a_revoked_drone_has_no_credentials(
    api: Any, db: Database, enrolled: Any, tmp_path: Path
) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    following = await rotate(api, drone_id)
    path = f"/v1/providers/{provider_id}/drones/{drone_id}"
    token = (await api(f"provider:{provider_id}", "POST", f"{path}/enrolment-tokens")).json()

    answer = await api(f"provider:{provider_id}", "DELETE", f"{path}/credentials")

    assert answer.status_code == 204
    assert drone_id not in accounts_in(tmp_path)
    assert [await whose(api, one["key"]) for one in (enrolled, following)] == [None, None]
    body = {"enrolment_token": token["enrolment_token"]}
    assert (await api(GATEWAY, "POST", "/v1/enrolments", body)).status_code == 403
    assert (await api(f"drone:{drone_id}", "POST", ROTATIONS)).status_code == 403
    assert await broken_rules(db, RULES) == []


async def test_a_revoked_drone_counts_as_lost(api: Any, db: Database, enrolled: Any) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    path = f"/v1/providers/{provider_id}/drones/{drone_id}"
    online = {"connection_status": "ONLINE", "connection_session": 1, "connection_number": 1}
    seen = {"last_seen_ms": 1_772_366_400_000, "last_seen_wall_ms": 1_772_366_400_000}
    async with db.write() as tx:
        await tx.execute(update(presence).values(online | seen))

    await api(f"provider:{provider_id}", "DELETE", f"{path}/credentials")

    assert (await api("operator:op", "GET", path)).json()["state"] == "OFFLINE"


async def test_a_revoked_drone_enrols_again_with_a_new_token(
    api: Any, enrolled: Any, tmp_path: Path
) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    path = f"/v1/providers/{provider_id}/drones/{drone_id}"
    await api(f"provider:{provider_id}", "DELETE", f"{path}/credentials")
    made = (await api(f"provider:{provider_id}", "POST", f"{path}/enrolment-tokens")).json()
    without = drone_id in accounts_in(tmp_path)

    body = {"enrolment_token": made["enrolment_token"]}
    again = (await api(GATEWAY, "POST", "/v1/enrolments", body)).json()

    assert not without
    assert logs_in(tmp_path, drone_id, again["mqtt"]["password"])
    assert await whose(api, again["key"]) == drone_id


async def test_a_removed_drone_has_no_credentials(api: Any, enrolled: Any, tmp_path: Path) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]

    await api(f"provider:{provider_id}", "DELETE", f"/v1/providers/{provider_id}/drones/{drone_id}")

    assert await whose(api, enrolled["key"]) is None
    assert drone_id not in accounts_in(tmp_path)


async def test_a_drone_sees_only_itself(api: Any, enrolled: Any) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    sibling = await api.drone(provider_id)
    fleet = f"/v1/providers/{provider_id}/drones"

    own = await api(f"drone:{drone_id}", "GET", f"{fleet}/{drone_id}")
    other = await api(f"drone:{drone_id}", "GET", f"{fleet}/{sibling['drone_id']}")
    elsewhere = await api(f"drone:{drone_id}", "GET", f"/v1/providers/prv_x/drones/{drone_id}")
    every = await api(f"drone:{drone_id}", "GET", fleet)

    assert own.json()["drone_id"] == drone_id
    assert (other.status_code, elsewhere.status_code, every.status_code) == (404, 404, 403)


async def revoked(db: Database) -> dict[str, str]:
    """The hashes of keys whose certificate is revoked, each with the drone's account."""
    async with db.read() as connection:
        return await credential_store.revoked_keys(connection)


async def test_each_end_of_a_key_revokes_the_certificate_that_came_with_it(
    api: Any, enrolled: Any, db: Database, clock: ManualClock
) -> None:
    drone_id, provider_id = enrolled["drone_id"], enrolled["provider_id"]
    path = f"/v1/providers/{provider_id}/drones/{drone_id}"
    ended: list[str] = []

    async def check(*keys: str) -> None:
        ended.extend(hashlib.sha256(key.encode()).hexdigest() for key in keys)
        assert await revoked(db) == dict.fromkeys(ended, f"{provider_id}/{drone_id}")
        assert await broken_rules(db, RULES) == []

    async def enrol_again() -> Any:
        token = await api(f"provider:{provider_id}", "POST", f"{path}/enrolment-tokens")
        body = {"enrolment_token": token.json()["enrolment_token"]}
        return (await api(GATEWAY, "POST", "/v1/enrolments", body)).json()

    unused = await rotate(api, drone_id)
    await check()
    following = await rotate(api, drone_id)
    await check(unused["key"])
    await whose(api, following["key"])
    await check(enrolled["key"])
    waiting = await rotate(api, drone_id)
    again = await enrol_again()
    await check(following["key"], waiting["key"])
    await api(f"provider:{provider_id}", "DELETE", f"{path}/credentials")
    await check(again["key"])
    last = await enrol_again()
    await api(f"provider:{provider_id}", "DELETE", path)
    await check(last["key"])

    clock.advance(CLIENT_LIFE)
    other = await api.drone(provider_id)
    await api(GATEWAY, "POST", "/v1/enrolments", {"enrolment_token": other["enrolment_token"]})
    assert set(await revoked(db)) == set(ended)
    clock.advance(timedelta(seconds=1))
    await rotate(api, other["drone_id"])
    assert await revoked(db) == {}
