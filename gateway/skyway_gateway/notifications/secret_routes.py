"""POST /v1/webhooks/{webhook_id}/secret-rotations."""

from datetime import timedelta
from typing import Annotated, Final

from fastapi import Request, Response
from pydantic import Field

from skyway.ids import WebhookId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.notifications.secret_store import (
    PreviousSecret,
    StoredSecrets,
    locked_secrets,
    put_secrets,
)
from skyway_gateway.notifications.secret_vault import SecretVault
from skyway_gateway.notifications.webhook import WallTime, new_webhook_secret
from skyway_gateway.notifications.webhook_store import webhook_of

#: How long a replaced secret still signs, wall time.
OVERLAP: Final = timedelta(hours=24)

#: The most replaced secrets that sign beside the present one: each makes the header longer.
MOST_PREVIOUS: Final = 3


class RotatedSecret(JsonModel):
    """The new signing secret of a webhook, which is shown only once."""

    webhook_id: Annotated[WebhookId, Field(description="The id of the webhook.")]
    secret: Annotated[
        str, Field(description="The signing secret (`whsec_...`); it is shown only once.")
    ]
    previous_until_wall_at: Annotated[
        WallTime, Field(description="Until when the previous secret signs as well, wall time.")
    ]


def secret_routes(*, db: Database, vault: SecretVault, clock: FleetClock) -> ServiceRouter:
    """POST /v1/webhooks/{webhook_id}/secret-rotations."""
    router = ServiceRouter(tags=("webhooks",))

    @router.post(
        "/v1/webhooks/{webhook_id}/secret-rotations",
        status_code=201,
        response_model=RotatedSecret,
        responses=conflicts("TOO_MANY_ROTATIONS"),
    )
    async def rotate_webhook_secret(
        request: Request,
        webhook_id: WebhookId,
        caller: KeyCaller,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Give a webhook a new signing secret, which is shown only in this answer.

        For 24 hours notifications carry a signature of the previous secret, too.

        Callers: customer.
        """
        caller.must_be("customer")

        async def write(tx: Tx) -> Answer:
            await webhook_of(tx.connection, caller, webhook_id)
            now = clock.wall_now()
            stored, secret, until = (
                await locked_secrets(tx, webhook_id),
                new_webhook_secret(),
                now + OVERLAP,
            )
            previous = stored.still_valid(now)
            if len(previous) >= MOST_PREVIOUS:
                raise Conflict(
                    "TOO_MANY_ROTATIONS",
                    f"{MOST_PREVIOUS} secrets of the last 24 hours still sign: use the newest one",
                )
            replaced = PreviousSecret(secret=stored.present, until_wall_ms=moment_to_ms(until))
            sealed = vault.seal(secret, webhook_id)
            after = StoredSecrets(webhook_id, sealed, (replaced, *previous))
            await put_secrets(tx, stored, after)
            shown = RotatedSecret(
                webhook_id=webhook_id, secret=secret, previous_until_wall_at=until
            )
            return Answer(201, shown.model_dump_json().encode())

        call = await keyed_call(request, caller, idempotency_key)
        return response_of(await once(db, call, act=write, clock=clock))

    return router
