"""Notifications of webhooks: verify first, then read."""

import json
from collections.abc import Mapping

from standardwebhooks import Webhook, WebhookVerificationError

from skyway_client.delivery_events import DeliveryEvent
from skyway_client.events import event_of
from skyway_client.models import TrialEvent


class NotVerified(Exception):
    """The notification was not signed with this secret within the last five minutes."""


def read_notification(
    secret: str, headers: Mapping[str, str], body: bytes
) -> DeliveryEvent | TrialEvent | None:
    """The event of a notification that Skyway signed; None for a type that a newer server added.

    A notification may arrive twice: remember the header `webhook-id`.

    Parameters
    ----------
    secret
        `whsec_...`, from the answer to `create_webhook`.
    body
        The bytes as they came: another spelling of the same JSON has another signature.

    Raises
    ------
    NotVerified
        A header is missing or malformed, the signature is wrong, or the time is not now.
    """
    try:
        Webhook(secret).verify(body, dict(headers), json_parse=False)
    except (WebhookVerificationError, ValueError) as error:
        raise NotVerified(str(error)) from error
    members = json.loads(body)
    return TrialEvent.from_dict(members) if members["type"] == "webhook.test" else event_of(members)
