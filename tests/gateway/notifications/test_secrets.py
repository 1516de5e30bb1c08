"""Signing secrets: encrypted at rest, rotated by customers, encrypted again with other keys."""

import asyncio
import json
import logging
from base64 import b64encode, urlsafe_b64encode
from collections.abc import AsyncIterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from skyway_gateway.notifications.seal_secrets import seal_secrets
from skyway_gateway.notifications.secret_vault import SecretVault, UnreadableSecret
from skyway_gateway.notifications.webhook import new_webhook_secret
from sqlalchemy import text
from standardwebhooks import Webhook, WebhookVerificationError

from skyway.errors import SkywayError
from skyway.ids import WebhookId
from skyway.runtime.errors import InvalidSettings
from tests.gateway.notifications.receiver import Receiver, receiving
from tests.gateway.whole_gateway import VAULT_KEY, Gateway

OTHER_KEY = urlsafe_b64encode(b"\xfb" * 32).decode()
WEBHOOK = WebhookId("whk_1")


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    async with receiving() as opened:
        yield opened


async def make_webhook(gateway: Gateway, url: str = "http://127.0.0.1:9/") -> dict[str, Any]:
    answer = await gateway.http.post("/v1/webhooks", json={"url": url}, headers=gateway.customer)
    made: dict[str, Any] = answer.json()
    return made


async def rotated(gateway: Gateway, webhook: Any, **headers: str) -> Any:
    path = f"/v1/webhooks/{webhook['webhook_id']}/secret-rotations"
    return await gateway.http.post(path, headers={**gateway.customer, **headers})


async def trial(gateway: Gateway, webhook: Any) -> Any:
    path = f"/v1/webhooks/{webhook['webhook_id']}/test"
    answer = await gateway.http.post(path, headers=gateway.customer)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def stored(gateway: Gateway) -> list[Any]:
    async with gateway.parts.db.read() as connection:
        return list(
            await connection.execute(
                text("SELECT webhook_id, secret, previous_secrets FROM webhooks")
            )
        )


def accepts(secret: str, receiver: Receiver) -> bool:
    try:
        Webhook(secret).verify(receiver.bodies[-1], receiver.received[-1][0])
    except WebhookVerificationError:
        return False
    return True


def vault(folder: Path, *keys: str) -> SecretVault:
    (folder / "webhook_keys").write_text("".join(f"{key}\n" for key in keys))
    return SecretVault(folder)


async def test_the_database_holds_no_secret_that_can_be_read(
    gateway: Gateway, tmp_path: Any
) -> None:
    first = (await make_webhook(gateway))["secret"]
    second = (await rotated(gateway, {"webhook_id": (await stored(gateway))[0].webhook_id})).json()

    content = b"".join(path.read_bytes() for path in tmp_path.glob("service.db*"))

    for secret in (first, second["secret"]):
        assert secret.encode() not in content
        assert secret.removeprefix("whsec_").encode() not in content


async def test_after_a_rotation_both_secrets_verify_for_a_day(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    # Receivers check the age of a signature against their own clock.
    begins = datetime.now(UTC) - timedelta(hours=24)
    gateway.clock.advance(begins - gateway.clock.wall_now())
    webhook = await make_webhook(gateway, receiver.url)
    answer = await rotated(gateway, webhook)
    assert answer.status_code == 201, answer.text
    new = answer.json()
    assert datetime.fromisoformat(new["previous_until_wall_at"]) - begins < timedelta(
        hours=24, seconds=1
    )

    gateway.clock.advance(timedelta(hours=23, minutes=59))
    await trial(gateway, webhook)
    both = [accepts(each["secret"], receiver) for each in (webhook, new)]
    gateway.clock.advance(timedelta(minutes=1))
    await trial(gateway, webhook)

    assert both == [True, True]
    assert [accepts(each["secret"], receiver) for each in (webhook, new)] == [False, True]


async def test_a_lost_answer_does_not_end_the_secret_that_the_receiver_has(
    gateway: Gateway, receiver: Receiver
) -> None:
    gateway.clock.advance(datetime.now(UTC) - gateway.clock.wall_now())
    webhook = await make_webhook(gateway, receiver.url)
    await rotated(gateway, webhook)  # its answer is lost
    new = (await rotated(gateway, webhook)).json()

    await trial(gateway, webhook)

    assert accepts(webhook["secret"], receiver)
    assert accepts(new["secret"], receiver)


async def test_too_many_rotations_are_refused_until_a_secret_has_ended(gateway: Gateway) -> None:
    webhook = await make_webhook(gateway)
    made = [(await rotated(gateway, webhook)).status_code for _ in range(3)]

    refused = await rotated(gateway, webhook)
    gateway.clock.advance(timedelta(hours=24))

    assert made == [201, 201, 201]
    assert (refused.status_code, refused.json()["code"]) == (409, "TOO_MANY_ROTATIONS")
    assert (await rotated(gateway, webhook)).status_code == 201


async def test_rotations_at_the_same_time_lose_no_secret(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    webhook = await make_webhook(gateway)

    answers = await asyncio.gather(*(rotated(gateway, webhook) for _ in range(3)))

    assert [answer.status_code for answer in answers] == [201, 201, 201]
    [row] = await stored(gateway)
    assert len(json.loads(row.previous_secrets)) == 3


async def test_a_repeated_rotation_is_answered_the_same(gateway: Gateway) -> None:
    webhook = await make_webhook(gateway)
    first = await rotated(gateway, webhook, **{"Idempotency-Key": "k"})

    assert (await rotated(gateway, webhook, **{"Idempotency-Key": "k"})).json() == first.json()


async def test_nobody_rotates_the_secret_of_another_customer(gateway: Gateway) -> None:
    webhook = await make_webhook(gateway)
    path = f"/v1/webhooks/{webhook['webhook_id']}/secret-rotations"

    for headers, status in ((gateway.other, 404), (gateway.operator, 403), (gateway.provider, 403)):
        assert (await gateway.http.post(path, headers=headers)).status_code == status


async def test_two_replicas_that_start_together_encrypt_with_another_key(
    gateway_on_both: Gateway, tmp_path: Path
) -> None:
    gateway = gateway_on_both
    webhook = await make_webhook(gateway)
    db, at = gateway.parts.db, gateway.clock.wall_now()
    keys = vault(tmp_path, OTHER_KEY, VAULT_KEY)

    found = await asyncio.gather(*(seal_secrets(db, keys, at=at) for _ in range(2)))

    assert found == [[], []]
    [row] = await stored(gateway)
    assert row.secret.startswith(keys.prefix)
    assert keys.open(row.secret, row.webhook_id) == webhook["secret"]


async def test_other_keys_encrypt_all_secrets_again(gateway: Gateway, tmp_path: Path) -> None:
    webhook = await make_webhook(gateway)
    await rotated(gateway, webhook)
    both = vault(tmp_path, OTHER_KEY, VAULT_KEY)

    assert await seal_secrets(gateway.parts.db, both, at=gateway.clock.wall_now()) == []

    alone = vault(tmp_path, OTHER_KEY)
    [row] = await stored(gateway)
    [previous] = json.loads(row.previous_secrets)
    assert alone.open(previous["secret"], row.webhook_id) == webhook["secret"]
    assert alone.open(row.secret, row.webhook_id).startswith("whsec_")


async def test_a_lost_key_is_named_and_stops_no_other_webhook(
    gateway: Gateway, tmp_path: Path, receiver: Receiver, caplog: pytest.LogCaptureFixture
) -> None:
    lost, whole = (
        await make_webhook(gateway, receiver.url),
        await make_webhook(gateway, receiver.url),
    )
    foreign = vault(tmp_path, OTHER_KEY).seal(lost["secret"], lost["webhook_id"])
    this = "UPDATE webhooks SET secret = :foreign WHERE webhook_id = :id"
    await gateway.execute(this, foreign=foreign, id=lost["webhook_id"])

    with caplog.at_level(logging.ERROR):
        found = await seal_secrets(
            gateway.parts.db, gateway.parts.vault, at=gateway.clock.wall_now()
        )

    assert found == [lost["webhook_id"]]
    assert "webhook_keys" in caplog.text
    attempt = await trial(gateway, lost)
    assert (attempt["outcome"], attempt["status"]) == ("GIVEN_UP", None)
    assert "secret-rotations" in attempt["detail"]
    assert (await trial(gateway, whole))["outcome"] == "DELIVERED"
    await rotated(gateway, lost)
    assert (await trial(gateway, lost))["outcome"] == "DELIVERED"


def test_a_secret_belongs_to_its_webhook(tmp_path: Path) -> None:
    keys, secret = vault(tmp_path, VAULT_KEY), new_webhook_secret()
    sealed = keys.seal(secret, WEBHOOK)

    assert keys.open(sealed, WEBHOOK) == secret
    assert keys.seal(secret, WEBHOOK) != sealed
    with pytest.raises(UnreadableSecret):
        keys.open(sealed, WebhookId("whk_2"))


@pytest.mark.parametrize(
    "damaged", ["", "v1", "v1.00000000.AAAA", "whsec_", "v1.{id}.AAA", "v1.{id}.====", "v2"]
)
def test_a_damaged_secret_is_unreadable(tmp_path: Path, damaged: str) -> None:
    keys = vault(tmp_path, VAULT_KEY)

    with pytest.raises(UnreadableSecret):
        keys.open(damaged.replace("{id}", keys.prefix[3:-1]), WEBHOOK)


@pytest.mark.parametrize(
    "lines", ["", "short", "not base64!", b64encode(bytes(31)).decode(), f"{VAULT_KEY}\nx"]
)
def test_a_wrong_file_of_keys_is_named(tmp_path: Path, lines: str) -> None:
    with pytest.raises(InvalidSettings, match="webhook_keys") as caught:
        vault(tmp_path, lines).require_keys()

    assert isinstance(caught.value, SkywayError)
    assert "short" not in str(caught.value)


def test_a_missing_file_of_keys_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match="webhook_keys"):
        SecretVault(tmp_path).require_keys()
