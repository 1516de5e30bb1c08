"""Signatures, checked by the reference implementation of Standard Webhooks; pauses of retries."""

import random
from datetime import UTC, datetime

import pytest
from skyway_gateway.notifications.webhook import (
    MOST_ATTEMPTS,
    asked_pause_s,
    new_webhook_secret,
    pause_s,
    signed_headers,
)
from standardwebhooks import Webhook, WebhookVerificationError

BODY = '{"type": "package.delivered", "data": {"place": "Zürich"}}'.encode()


def test_a_receiver_with_the_secret_accepts_a_signed_notification() -> None:
    secret = new_webhook_secret()
    headers = signed_headers((secret,), webhook_id="evt_1", at=datetime.now(UTC), body=BODY)
    assert Webhook(secret).verify(BODY, headers)["type"] == "package.delivered"


@pytest.mark.parametrize("changed", ["webhook-id", "webhook-timestamp", "body", "secret"])
def test_a_receiver_refuses_a_changed_notification(changed: str) -> None:
    secret, body = new_webhook_secret(), BODY
    headers = signed_headers((secret,), webhook_id="evt_1", at=datetime.now(UTC), body=body)
    if changed == "body":
        body = body.replace(b"package", b"baggage")
    elif changed == "secret":
        secret = new_webhook_secret()
    elif changed == "webhook-id":
        headers["webhook-id"] = "evt_2"
    else:
        headers["webhook-timestamp"] = str(int(headers["webhook-timestamp"]) + 1)
    with pytest.raises(WebhookVerificationError):
        Webhook(secret).verify(body, headers)


def test_signing_secrets_are_long_and_unique() -> None:
    secrets = {new_webhook_secret() for _ in range(100)}
    assert len(secrets) == 100
    assert all(secret.startswith("whsec_") and len(secret) == 50 for secret in secrets)


def test_pauses_grow_and_end() -> None:
    chance = random.Random(1)
    pauses = [pause_s(attempts, chance) for attempts in range(1, MOST_ATTEMPTS + 2)]
    assert pauses[-2:] == [None, None]
    given = [pause for pause in pauses if pause is not None]
    assert len(given) == MOST_ATTEMPTS - 1
    assert given == sorted(given)
    assert 4 <= given[0] <= 6
    assert sum(given) > 24 * 3600


@pytest.mark.parametrize(
    ("retry_after", "asked_s"),
    [
        ("18", 18.0),
        ("0", 0.0),
        ("Sun, 01 Mar 2026 12:01:30 GMT", 90.0),
        ("Sunday, 01-Mar-26 12:01:30 GMT", 90.0),
        ("Sun, 01 Mar 2026 11:00:00 GMT", 0.0),
        ("Fri, 31 Dec 9999 23:59:59 -2359", 86_400.0),
        ("9" * 5_000, 86_400.0),
        ("-5", 0.0),
        ("1.5", 0.0),
        ("soon", 0.0),
        ("", 0.0),
        (None, 0.0),
    ],
)
def test_a_receiver_asks_for_a_pause_of_at_most_a_day(
    retry_after: str | None, asked_s: float
) -> None:
    assert asked_pause_s(retry_after, datetime(2026, 3, 1, 12, tzinfo=UTC)) == asked_s


def test_no_pause_is_shorter_than_the_receiver_asks() -> None:
    chance = random.Random(1)

    assert pause_s(1, chance, asked_s=18.0) == 18.0
    assert (pause_s(4, chance, asked_s=18.0) or 0) > 600
    assert pause_s(MOST_ATTEMPTS, chance, asked_s=18.0) is None


def test_pauses_vary_between_notifications() -> None:
    chance = random.Random(1)
    assert len({pause_s(3, chance) for _ in range(20)}) == 20
