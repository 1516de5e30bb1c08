"""The key with which a drone signs comes, changes and goes with its credentials."""

import hashlib
from datetime import timedelta
from typing import Any

import pytest
from skyway_verifier.registry.rules import RULES
from sqlalchemy import text

from skyway.runtime.clock import ManualClock
from skyway.runtime.signing.key_pair import PrivateKey
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.signing_files import PUBLIC_KEYS

pytestmark = pytest.mark.databases("sqlite")

GATEWAY = "service:gateway"
FIRST, SECOND = PrivateKey(b"1" * 32).public_key, PrivateKey(b"2" * 32).public_key


async def signature_of(api: Any, drone_id: str) -> Any:
    body = {"drone_ids": [drone_id]}
    answer = await api(None, "POST", "/internal/drone-signatures", body, service="composition")
    (found,) = answer.json()["signatures"]
    return found["is_signed"], found["public_key"]


async def enrol(api: Any, drone: Any, public_key: str | None, token: str | None = None) -> Any:
    body = {"enrolment_token": token or drone["enrolment_token"]}
    if public_key is not None:
        body["public_key"] = public_key
    return await api(GATEWAY, "POST", "/v1/enrolments", body)


async def another_token(api: Any, drone: Any) -> str:
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/enrolment-tokens"
    return str((await api("operator:op", "POST", path)).json()["enrolment_token"])


async def rotate(api: Any, drone_id: str, body: Any = None) -> Any:
    return await api(f"drone:{drone_id}", "POST", "/v1/enrolments/rotations", body)


async def show(api: Any, key: str) -> None:
    body = {"key_hash": hashlib.sha256(key.encode()).hexdigest()}
    answer = await api(None, "POST", "/internal/drone-keys", body)
    assert answer.json()["drone_id"] is not None


@pytest.fixture
async def signing(api: Any) -> Any:
    """A drone that has enrolled with its first key."""
    drone = await api.drone(await api.provider())
    return (await enrol(api, drone, FIRST)).json()


async def test_a_drone_registers_its_key_and_gets_those_of_the_cloud(api: Any) -> None:
    drone = await api.drone(await api.provider(), public_key=FIRST)

    assert drone["cloud_keys"] == PUBLIC_KEYS.model_dump(mode="json")
    assert await signature_of(api, drone["drone_id"]) == (True, FIRST)


async def test_a_drone_without_a_key_is_served_unsigned(api: Any) -> None:
    drone = await api.drone(await api.provider())
    enrolled = await enrol(api, drone, None)

    assert enrolled.json()["cloud_keys"] == PUBLIC_KEYS.model_dump(mode="json")
    assert await signature_of(api, drone["drone_id"]) == (False, None)
    assert (await rotate(api, drone["drone_id"])).status_code == 201


async def test_enrolling_brings_a_key(api: Any, signing: Any) -> None:
    assert await signature_of(api, signing["drone_id"]) == (True, FIRST)


async def test_a_rotated_key_counts_from_the_first_use_of_the_credentials(
    api: Any, signing: Any, db: Database
) -> None:
    drone_id = signing["drone_id"]
    following = (await rotate(api, drone_id, {"public_key": SECOND})).json()
    before = await signature_of(api, drone_id)
    await show(api, following["key"])

    assert before == (True, FIRST)
    assert await signature_of(api, drone_id) == (True, SECOND)
    assert await broken_rules(db, RULES) == []


async def test_a_drone_begins_to_sign_with_a_rotation(api: Any) -> None:
    drone = await api.drone(await api.provider())
    await enrol(api, drone, None)
    following = (await rotate(api, drone["drone_id"], {"public_key": FIRST})).json()
    before = await signature_of(api, drone["drone_id"])
    await show(api, following["key"])

    assert before == (False, None)
    assert await signature_of(api, drone["drone_id"]) == (True, FIRST)


async def test_nothing_of_a_revoked_drone_is_believed_until_it_has_another_key(
    api: Any, signing: Any
) -> None:
    drone_id = signing["drone_id"]
    path = f"/v1/providers/{signing['provider_id']}/drones/{drone_id}/credentials"
    await api("operator:op", "DELETE", path)
    revoked = await signature_of(api, drone_id)
    token = await another_token(api, signing)
    unsigned = await enrol(api, signing, None, token)
    signed = await enrol(api, signing, SECOND, token)

    assert revoked == (True, None)
    assert (unsigned.status_code, signed.status_code) == (422, 201)
    assert await signature_of(api, drone_id) == (True, SECOND)


async def credentials_without_a_key(api: Any, drone: Any) -> str:
    """The key of the credentials that the owner gets by a token, after a thief's rotation."""
    token = await another_token(api, drone)
    await enrol(api, drone, None, token)
    return str((await rotate(api, drone["drone_id"])).json()["key"])


async def rotation_without_a_key(api: Any, drone: Any) -> str:
    """The key of the drone's own next rotation, after a thief's rotation."""
    return str((await rotate(api, drone["drone_id"])).json()["key"])


async def credentials_after_a_revocation(api: Any, drone: Any) -> str:
    """The key of the drone's rotation after its credentials were revoked and issued again."""
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/credentials"
    await api("operator:op", "DELETE", path)
    return await credentials_without_a_key(api, drone)


@pytest.mark.parametrize(
    "recover",
    [credentials_without_a_key, rotation_without_a_key, credentials_after_a_revocation],
)
async def test_a_next_key_that_a_thief_named_never_comes_into_force(
    api: Any, recover: Any, db: Database
) -> None:
    drone = await api.drone(await api.provider())
    await enrol(api, drone, None)
    await rotate(api, drone["drone_id"], {"public_key": SECOND})

    await show(api, await recover(api, drone))

    assert await signature_of(api, drone["drone_id"]) == (False, None)
    assert await broken_rules(db, RULES) == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_revocation_forgets_the_next_key_of_a_drone_that_does_not_sign(
    api: Any, db: Database
) -> None:
    drone = await api.drone(await api.provider())
    await enrol(api, drone, None)
    await rotate(api, drone["drone_id"], {"public_key": SECOND})
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/credentials"

    await api("operator:op", "DELETE", path)

    async with db.read() as connection:
        keys = (
            await connection.execute(text("SELECT next_public_key FROM drone_signing_keys"))
        ).all()
    assert [tuple(row) for row in keys] == [(None,)]


async def test_a_drone_that_signs_cannot_leave_its_key_out(api: Any, signing: Any) -> None:
    refused = await rotate(api, signing["drone_id"])

    assert refused.status_code == 422
    assert "public_key" in refused.text


@pytest.mark.parametrize("key", ["x", "A" * 43, FIRST + "="], ids=["short", "zero", "padded"])
async def test_what_is_no_key_is_refused(api: Any, key: str) -> None:
    drone = await api.drone(await api.provider())
    provider_id = drone["provider_id"]
    body = {"model_id": "paper-scenario", "home_station_id": "san-marcos", "public_key": key}

    registered = await api("operator:op", "POST", f"/v1/providers/{provider_id}/drones", body)
    enrolled = await enrol(api, drone, key)

    assert (registered.status_code, enrolled.status_code) == (422, 422)
    assert await signature_of(api, drone["drone_id"]) == (False, None)


async def test_changed_keys_are_named_for_a_minute(
    api: Any, signing: Any, clock: ManualClock
) -> None:
    async def changed() -> list[str]:
        answer = await api(None, "POST", "/internal/drone-signatures", {}, service="composition")
        return [each["drone_id"] for each in answer.json()["signatures"]]

    at_once = await changed()
    clock.advance(timedelta(seconds=61))

    assert at_once == [signing["drone_id"]]
    assert await changed() == []


async def test_an_unknown_drone_is_left_out(api: Any) -> None:
    body = {"drone_ids": ["drn_0"]}
    answer = await api(None, "POST", "/internal/drone-signatures", body, service="composition")

    assert answer.json()["signatures"] == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_verify_names_a_key_that_is_none(api: Any, signing: Any, db: Database) -> None:
    async with db.write() as tx:
        await tx.execute(text("UPDATE drone_signing_keys SET public_key = :key"), {"key": "A" * 43})

    assert len(await broken_rules(db, RULES)) == 1


@pytest.mark.databases("sqlite", "postgresql")
@pytest.mark.parametrize(
    "damage",
    [
        "DELETE FROM drone_signing_keys",
        "UPDATE drone_signing_keys SET is_required = (1 = 0), public_key = NULL",
    ],
)
async def test_a_lost_key_never_makes_unsigned_messages_valid(
    api: Any, signing: Any, db: Database, damage: str
) -> None:
    drone_id = signing["drone_id"]
    async with db.write() as tx:
        await tx.execute(text(damage))
    lost = await signature_of(api, drone_id)
    found = await broken_rules(db, RULES)
    token = await another_token(api, signing)
    unsigned = await enrol(api, signing, None, token)
    signed = await enrol(api, signing, SECOND, token)

    assert lost == (True, None)
    assert found == [("a drone that has ever signed has the row of its key", drone_id)]
    assert (unsigned.status_code, signed.status_code) == (422, 201)
    assert await signature_of(api, drone_id) == (True, SECOND)
    assert await broken_rules(db, RULES) == []


@pytest.mark.parametrize("way", ["registration", "enrolment", "rotation"])
async def test_a_drone_is_noted_as_signing_however_its_key_came(
    api: Any, way: str, db: Database
) -> None:
    if way == "registration":
        drone = await api.drone(await api.provider(), public_key=FIRST)
    else:
        drone = await api.drone(await api.provider())
        await enrol(api, drone, FIRST if way == "enrolment" else None)
    if way == "rotation":
        following = (await rotate(api, drone["drone_id"], {"public_key": FIRST})).json()
        await show(api, following["key"])
    async with db.write() as tx:
        await tx.execute(text("DELETE FROM drone_signing_keys"))

    assert await signature_of(api, drone["drone_id"]) == (True, None)
