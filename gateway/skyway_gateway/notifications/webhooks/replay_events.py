"""Queues past events again for a webhook; the sender sends them like new ones."""

from skyway.errors import InvalidInput
from skyway.ids import SubjectId, WebhookId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.notifications.webhooks import replay_store, webhook_store
from skyway_gateway.notifications.webhooks.replay_store import MOST_EVENTS, Replay, ReplayRequest


async def replay(
    db: Database,
    caller: Caller,
    webhook_id: WebhookId,
    requested: ReplayRequest,
    *,
    clock: FleetClock,
    wake: Wake,
) -> Replay:
    """Queue events again for the caller's own webhook.

    Raises
    ------
    NotFound
        The webhook, the delivery or one of the events is not the caller's.
    Conflict
        WEBHOOK_DISABLED: nothing is sent to a disabled webhook.
    InvalidInput
        The span holds more events than one call may queue.
    """
    customer_id = SubjectId(caller.subject_id)
    async with db.write() as tx:
        webhook = await webhook_store.webhook_of(tx.connection, caller, webhook_id)
        if webhook.state != "ACTIVE":
            raise Conflict("WEBHOOK_DISABLED", f"webhook {webhook_id} is disabled")
        await _refuse_foreign(tx, requested, customer_id)
        which = replay_store.requested_events(
            requested, customer_id=customer_id, event_types=webhook.event_types
        )
        if (
            await replay_store.count_requested(tx.connection, which, at_most=MOST_EVENTS)
            > MOST_EVENTS
        ):
            detail = f"more than {MOST_EVENTS} events in one call: shorten the span"
            raise InvalidInput("from", detail)
        queued = await replay_store.queue_again(tx, webhook_id, which, at=clock.wall_now())
        tx.after_commit(wake.set)
    count("skyway_webhook_replays", "notifications queued again", float(queued))
    return Replay(queued=queued)


async def _refuse_foreign(tx: Tx, requested: ReplayRequest, customer_id: SubjectId) -> None:
    """Answer 404 for events and deliveries of other customers."""
    if requested.event_ids is not None:
        own = await replay_store.own_events(
            tx.connection, requested.event_ids, customer_id=customer_id
        )
        for event_id in requested.event_ids:
            if event_id not in own:
                raise NotFound("event", event_id)
    if requested.delivery_id is not None and not await replay_store.has_delivery(
        tx.connection, requested.delivery_id, customer_id=customer_id
    ):
        raise NotFound("delivery", requested.delivery_id)
