"""Signatures, checked by the reference implementation of Standard Webhooks."""

from datetime import UTC, datetime

import pytest
from skyway_gateway.notifications.webhooks.signature import new_webhook_secret, signed_headers
from standardwebhooks import Webhook, WebhookVerificationError

BODY = '{"type": "package.delivered", "data": {"place": "Zürich"}}'.encode()


def test_a_receiver_with_the_secret_accepts_a_signed_notification() -> None:
    secret = new_webhook_secret()
    headers = signed_headers(secret, webhook_id="evt_1", at=datetime.now(UTC), body=BODY)
    assert Webhook(secret).verify(BODY, headers)["type"] == "package.delivered"


@pytest.mark.parametrize("changed", ["webhook-id", "webhook-timestamp", "body", "secret"])
def test_a_receiver_refuses_a_changed_notification(changed: str) -> None:
    secret, body = new_webhook_secret(), BODY
    headers = signed_headers(secret, webhook_id="evt_1", at=datetime.now(UTC), body=body)
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
