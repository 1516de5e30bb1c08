"""Webhooks over REST, and the fleet clock; a delivery's own event stream is the delivery's.

The calls that customers' webhooks receive are here for the OpenAPI document. Nobody calls them:
`send_webhooks` makes these calls.
"""

from datetime import timedelta
from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, Header, Query, Request, Response
from pydantic import Field

from skyway.contracts.delivery_event_examples import delivery_event_examples
from skyway.contracts.delivery_event_forms import AnyDeliveryEvent
from skyway.contracts.statement_event import StatementClosed
from skyway.ids import SubjectId, WebhookId, kind_for
from skyway.json_model import JsonModel
from skyway.runtime.clock import AnchoredClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter, operation_id
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.limits import Slots
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context
from skyway_gateway.notifications import webhook_store
from skyway_gateway.notifications.fleet_time import FleetTime, fleet_time
from skyway_gateway.notifications.post_webhook import Targets
from skyway_gateway.notifications.replay_store import Replay, ReplayRequest, replay
from skyway_gateway.notifications.secret_store import (
    PreviousSecret,
    StoredSecrets,
    locked_secrets,
    put_secrets,
)
from skyway_gateway.notifications.secret_vault import SecretVault
from skyway_gateway.notifications.send_webhooks import WebhookSender
from skyway_gateway.notifications.webhook import (
    IssuedWebhook,
    NewWebhook,
    TrialEvent,
    WallTime,
    Webhook,
    WebhookAttempt,
    WebhookChange,
    new_webhook_secret,
)
from skyway_gateway.notifications.webhook_store import WebhookQuota, attempts_page, webhook_of

DELIVERY_EVENT: Final = "delivery-event"

_ANSWERS: Final[dict[int | str, dict[str, Any]]] = {  # a part of the OpenAPI document
    "2XX": {
        "description": "Received. After any other answer, or none in time, it is sent again later."
    }
}

_Id = Annotated[
    str, Header(alias="webhook-id", description="The event's id, the same for each try.")
]

_Timestamp = Annotated[
    int, Header(alias="webhook-timestamp", description="When it is sent: seconds since 1970.")
]

_Signature = Annotated[
    str,
    Header(
        alias="webhook-signature",
        description="`v1,` and the base64 HMAC-SHA256 of id, timestamp and body (Standard "
        "Webhooks), with the secret of the webhook; after a rotation one for each valid secret.",
    ),
]


def clock_routes(*, anchor: AnchoredClock) -> ServiceRouter:
    """GET /v1/clock."""
    router = ServiceRouter(tags=("clock",))

    @router.get("/v1/clock")
    async def get_clock(_caller: KeyCaller) -> FleetTime:
        """Show fleet time, and the anchor from which it is computed.

        Callers: every API key.
        """
        return fleet_time(anchor)

    return router


def webhook_routes(
    context: Context,
    *,
    targets: Targets,
    quota: WebhookQuota,
    trials: Slots,
    vault: SecretVault,
    sender: WebhookSender,
) -> ServiceRouter:
    """/v1/webhooks: POST, GET, PATCH, DELETE, and `/test`, `/attempts`, `/replay` of each."""
    router = ServiceRouter(tags=("webhooks",))

    @router.post(
        "/v1/webhooks",
        status_code=201,
        response_model=IssuedWebhook,
        responses=conflicts("TOO_MANY_WEBHOOKS"),
    )
    async def create_webhook(
        request: Request,
        caller: KeyCaller,
        requested: NewWebhook,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Have the events of deliveries sent to a URL; its secret is shown only in this answer.

        Callers: customer.
        """
        caller.must_be("customer")
        await targets.check(requested.url, SubjectId(caller.subject_id))
        webhook = IssuedWebhook(
            webhook_id=WebhookId(context.mint(kind_for(caller.subject_id, "whk"))),
            url=requested.url,
            event_types=requested.event_types,
            state="ACTIVE",
            disabled_reason=None,
            created_wall_at=context.clock.wall_now(),
            secret=new_webhook_secret(),
        )

        async def keep(tx: Tx) -> Answer:
            owner = SubjectId(caller.subject_id)
            await quota.refuse_too_many(tx, owner)
            stored = vault.seal(webhook.secret, webhook.webhook_id)
            await webhook_store.add_webhook(tx, webhook, customer_id=owner, stored_secret=stored)
            location = {"Location": f"/v1/webhooks/{webhook.webhook_id}"}
            return Answer(201, webhook.model_dump_json().encode(), location)

        call = await keyed_call(request, caller, idempotency_key)
        return response_of(await once(context.db, call, act=keep, clock=context.clock))

    @router.get("/v1/webhooks")
    async def list_webhooks(
        caller: KeyCaller, query: Annotated[PageQuery, Query()]
    ) -> Page[Webhook]:
        """List the caller's webhooks, without their secrets.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            found = await webhook_store.webhooks_page(connection, caller, query)
        return page_of(found, query, item=lambda it: it, sort_key=lambda it: (it.webhook_id,))

    @router.get("/v1/webhooks/{webhook_id}")
    async def get_webhook(webhook_id: WebhookId, caller: KeyCaller) -> Webhook:
        """Show a webhook, without its secret.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            return await webhook_store.webhook_of(connection, caller, webhook_id)

    @router.patch("/v1/webhooks/{webhook_id}")
    async def update_webhook(
        webhook_id: WebhookId,
        caller: KeyCaller,
        requested: WebhookChange,
    ) -> Webhook:
        """Change the URL or the events of a webhook, or make a disabled one active again.

        Callers: customer.
        """
        caller.must_be("customer")
        if requested.url is not None:
            await targets.check(requested.url, SubjectId(caller.subject_id))
        async with context.db.write() as tx:
            webhook = await webhook_store.webhook_of(tx.connection, caller, webhook_id)
            changed = webhook.merged(requested)
            if requested.state is not None:
                by_customer = "by its customer" if requested.state == "DISABLED" else None
                changed = changed.model_copy(update={"disabled_reason": by_customer})
            await webhook_store.change_webhook(tx, changed, at=context.clock.wall_now())
        return changed

    @router.delete("/v1/webhooks/{webhook_id}", status_code=204)
    async def delete_webhook(webhook_id: WebhookId, caller: KeyCaller) -> Response:
        """Delete a webhook and its attempts.

        Callers: customer.
        """
        caller.must_be("customer")
        async with context.db.write() as tx:
            await webhook_store.webhook_of(tx.connection, caller, webhook_id)
            await webhook_store.delete_webhook(tx, webhook_id)
        return Response(status_code=204)

    @router.post("/v1/webhooks/{webhook_id}/test")
    async def test_webhook(webhook_id: WebhookId, caller: KeyCaller) -> WebhookAttempt:
        """Send a `webhook.test` event once, now, and show how it was answered.

        Callers: customer.
        """
        caller.must_be("customer")
        async with context.db.read() as connection:
            now = context.clock.wall_now()
            endpoint = await webhook_store.endpoint_of(connection, caller, webhook_id, at=now)
        with trials.held(str(caller)):
            return await sender.send_trial(endpoint)

    @router.post(
        "/v1/webhooks/{webhook_id}/replay",
        status_code=202,
        responses=conflicts("WEBHOOK_DISABLED"),
    )
    async def replay_webhook(
        webhook_id: WebhookId, caller: KeyCaller, requested: ReplayRequest
    ) -> Replay:
        """Send past events again, with their own ids and in their order.

        Callers: customer.
        """
        caller.must_be("customer")
        return await replay(
            context.db, caller, webhook_id, requested, clock=context.clock, wake=sender.wake
        )

    @router.get("/v1/webhooks/{webhook_id}/attempts")
    async def list_webhook_attempts(
        webhook_id: WebhookId,
        caller: KeyCaller,
        query: Annotated[PageQuery, Query()],
    ) -> Page[WebhookAttempt]:
        """List the attempts to notify a webhook, the newest first.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            await webhook_store.webhook_of(connection, caller, webhook_id)
            found = await attempts_page(connection, webhook_id, query)
        return page_of(found, query, item=lambda it: it, sort_key=lambda it: (it.attempt_id,))

    return router


def with_event_examples(document: dict[str, Any]) -> dict[str, Any]:  # a JSON document
    """The document with an example of each delivery event: FastAPI drops what is null in them."""
    call = document["webhooks"][DELIVERY_EVENT]["post"]
    media = call["requestBody"]["content"]["application/json"]
    media.pop("example", None)
    media["examples"] = {
        event.type: {"summary": type(event).__doc__, "value": event.model_dump(mode="json")}
        for event in delivery_event_examples()
    }
    return document


def webhook_calls() -> APIRouter:
    """The calls to a customer's URL."""
    router = APIRouter(tags=["webhooks"], generate_unique_id_function=operation_id)

    @router.post(DELIVERY_EVENT, responses=_ANSWERS, response_class=Response)
    def receive_delivery_event(
        webhook_id: _Id,
        webhook_timestamp: _Timestamp,
        webhook_signature: _Signature,
        event: Annotated[AnyDeliveryEvent, Body()],
    ) -> None:
        """An event of one of the customer's deliveries, in the order of its `sequence`."""

    @router.post("statement-closed", responses=_ANSWERS, response_class=Response)
    def receive_statement_closed(
        webhook_id: _Id,
        webhook_timestamp: _Timestamp,
        webhook_signature: _Signature,
        event: StatementClosed,
    ) -> None:
        """A month is closed: what the customer pays for it, in each currency."""

    @router.post("webhook-test", responses=_ANSWERS, response_class=Response)
    def receive_test_event(
        webhook_id: _Id,
        webhook_timestamp: _Timestamp,
        webhook_signature: _Signature,
        event: TrialEvent,
    ) -> None:
        """The event that `POST /v1/webhooks/{webhook_id}/test` sends."""

    return router


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


def secret_routes(context: Context, *, vault: SecretVault) -> ServiceRouter:
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
            now = context.clock.wall_now()
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
        return response_of(await once(context.db, call, act=write, clock=context.clock))

    return router
