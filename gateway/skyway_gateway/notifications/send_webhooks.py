"""Notifies webhooks: signed, at least once, in the order of each delivery's events.

Each endpoint has its own task, so that a slow endpoint delays no other; `fair_slots` shares the
tasks between customers. A notification keeps its id in all attempts; later notifications of the
same delivery wait for it. After the last attempt the notification is given up, and the customer can
see that.
"""

import asyncio
import logging
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final, Never, get_args

from skyway.ids import EventId, is_live_id
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.loops import MissingParts, Wake, always, repeat
from skyway.runtime.metrics import count, observe
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import current_traceparent, tracing
from skyway_gateway.notifications.fair_slots import FairSlots
from skyway_gateway.notifications.post_webhook import Reply, WebhookPost
from skyway_gateway.notifications.secret_vault import SecretVault, UnreadableSecret
from skyway_gateway.notifications.webhook import (
    Endpoint,
    Notification,
    Outcome,
    TrialData,
    TrialEvent,
    WebhookAttempt,
    asked_pause_s,
    pause_s,
    signed_headers,
)
from skyway_gateway.notifications.webhook_store import (
    add_attempt,
    claim_due,
    disable_webhook,
    due_endpoints,
    free_claims,
    settle,
)

log = logging.getLogger(__name__)

#: Notifications that are sent at the same time to one endpoint, each of another delivery.
_AT_ONE_ENDPOINT: Final = 4

#: Longest pause between two looks at the table, seconds: other replicas write to it, too.
_LONGEST_PAUSE_S: Final = 1.0

#: Seconds of wall time until an endpoint is served again after a failure on our side.
_AFTER_FAILURE_S: Final = 1.0


#: What the customer is shown of a notification that cannot be signed.
_UNREADABLE: Final = (
    "the signing secret cannot be read: get another one with POST "
    "/v1/webhooks/{webhook_id}/secret-rotations"
)


@dataclass(frozen=True, slots=True)
class _Sent:
    """One attempt: when it began, how long it took, and the reply."""

    at: datetime
    duration_ms: int
    reply: Reply


@dataclass(slots=True)
class WebhookSender:
    """The loop that notifies webhooks."""

    db: Database
    post: WebhookPost
    vault: SecretVault
    wake: Wake
    clock: FleetClock
    mint: Mint
    slots: FairSlots = field(default_factory=FairSlots)
    chance: random.Random = field(default_factory=random.SystemRandom)
    _missing: MissingParts = field(default_factory=lambda: MissingParts("webhooks"))
    _claims_are_free: bool = False

    async def run(self, *, polls: Callable[[], bool] = always) -> Never:
        """Notify until the process ends; look at the table unasked only while it `polls`."""
        for outcome in get_args(Outcome):
            _count_attempts(0, outcome)
        async with asyncio.TaskGroup() as group:
            await repeat(
                "webhooks",
                lambda: self._step(group),
                every_s=_LONGEST_PAUSE_S,
                wake=self.wake,
                polls=polls,
            )

    async def _step(self, group: asyncio.TaskGroup) -> bool:
        if self.db.dialect == "sqlite" and not self._claims_are_free:
            async with self.db.write() as tx:
                await free_claims(tx)
            self._claims_are_free = True
        async with self.db.read() as connection:
            due = await due_endpoints(connection, at=self.clock.wall_now())
        for endpoint in self.slots.choose(due):
            group.create_task(self._serve(endpoint))
        return False

    async def _serve(self, endpoint: Endpoint) -> None:
        """The task of one endpoint: its failure must not end the tasks of others."""
        try:
            await self.notify(endpoint)
            self._missing.are_back()
        except Exception as error:
            count("skyway_webhook_failures", "rounds of an endpoint that broke")
            if not self._missing.note(error):
                log.exception("notifying failed", extra={"webhook_id": endpoint.webhook_id})
            await sleep_wall(self.clock, _AFTER_FAILURE_S)
        finally:
            self.slots.release(endpoint)
            self.wake.set()

    async def notify(self, endpoint: Endpoint) -> int:
        """Send what is due at one endpoint now; how many notifications that were."""
        due = await claim_due(
            self.db,
            endpoint.webhook_id,
            limit=_AT_ONE_ENDPOINT,
            claimant=self.mint("snd"),
            clock=self.clock,
        )
        async with asyncio.TaskGroup() as group:
            for notification in due:
                group.create_task(self._try(endpoint, notification))
        return len(due)

    async def send_trial(self, endpoint: Endpoint) -> WebhookAttempt:
        """Send a test event once, before anything that is due, and store the attempt."""
        now = self.clock.now()
        event = TrialEvent(
            livemode=is_live_id(endpoint.webhook_id),
            type="webhook.test",
            message_id=self.mint("msg"),
            sent_at=now,
            event_id=EventId(self.mint("evt")),
            occurred_at=now,
            data=TrialData(webhook_id=endpoint.webhook_id),
        )
        trial = Notification(
            event_id=event.event_id,
            event_type=event.type,
            delivery_id=None,
            attempts=0,
            body=event.model_dump_json().encode(),
        )
        attempt = self._attempt(trial, await self._send(endpoint, trial), wait_s=None)
        async with self.db.write() as tx:
            await add_attempt(tx, endpoint.webhook_id, attempt)
        return attempt

    async def _try(self, endpoint: Endpoint, notification: Notification) -> None:
        with tracing(notification.traceparent, "notify webhook"):
            await self._send_and_settle(endpoint, notification)

    async def _send_and_settle(self, endpoint: Endpoint, notification: Notification) -> None:
        sent = await self._send(endpoint, notification)
        attempt = self._attempt(notification, sent, wait_s=self._wait_s(notification, sent))
        _count_attempts(1, attempt.outcome)
        about, duration_s = "time until an endpoint answered", attempt.duration_ms / 1000
        observe("skyway_webhook_duration_seconds", about, duration_s, outcome=attempt.outcome)
        async with self.db.write() as tx:
            # Nothing to note if the webhook was deleted meanwhile or another replica was faster.
            if not await settle(tx, endpoint.webhook_id, notification.event_id, attempt=attempt):
                return
            await add_attempt(tx, endpoint.webhook_id, attempt)
            if sent.reply.is_gone:
                await disable_webhook(
                    tx, endpoint.webhook_id, reason="it answered 410", at=self.clock.wall_now()
                )

    async def _send(self, endpoint: Endpoint, notification: Notification) -> _Sent:
        at, loop = self.clock.wall_now(), asyncio.get_running_loop()
        started_s = loop.time()
        secrets_in_use = self._secrets_of(endpoint)
        if not secrets_in_use:
            return _Sent(at, 0, Reply(None, _UNREADABLE))
        headers = signed_headers(
            secrets_in_use, webhook_id=notification.event_id, at=at, body=notification.body
        )
        if (traceparent := current_traceparent()) is not None:
            headers["traceparent"] = traceparent
        reply = await self.post.send(
            endpoint.url, endpoint.customer_id, headers=headers, body=notification.body
        )
        self.slots.note_reply(endpoint.webhook_id, is_answer=reply.status is not None)
        return _Sent(at, round((loop.time() - started_s) * 1000), reply)

    def _secrets_of(self, endpoint: Endpoint) -> tuple[str, ...]:
        """The secrets that can be decrypted."""
        found: list[str] = []
        for stored in endpoint.stored_secrets:
            try:
                found.append(self.vault.open(stored, endpoint.webhook_id))
            except UnreadableSecret as error:
                count("skyway_webhook_secrets_unreadable", "secrets that could not be decrypted")
                about = {"webhook_id": endpoint.webhook_id, "detail": str(error)}
                log.warning("secret of a webhook cannot be decrypted", extra=about)
        return tuple(found)

    def _wait_s(self, notification: Notification, sent: _Sent) -> float | None:
        """Seconds from this attempt to the next one; None when there is none."""
        if sent.reply.is_success or sent.reply.is_gone:
            return None
        asked_s = asked_pause_s(sent.reply.retry_after, sent.at)
        return pause_s(notification.attempts + 1, self.chance, asked_s=asked_s)

    def _attempt(
        self, notification: Notification, sent: _Sent, *, wait_s: float | None
    ) -> WebhookAttempt:
        return WebhookAttempt(
            attempt_id=self.mint("att"),
            event_id=notification.event_id,
            event_type=notification.event_type,
            delivery_id=notification.delivery_id,
            number=notification.attempts + 1,
            wall_at=sent.at,
            duration_ms=sent.duration_ms,
            outcome=_outcome(sent.reply, wait_s),
            status=sent.reply.status_class,
            detail=sent.reply.detail,
            next_try_wall_at=None if wait_s is None else sent.at + timedelta(seconds=wait_s),
        )


def _count_attempts(attempts: int, outcome: Outcome) -> None:
    count("skyway_webhook_attempts", "tries to notify", attempts, outcome=outcome)


def _outcome(reply: Reply, wait_s: float | None) -> Outcome:
    if reply.is_success:
        return "DELIVERED"
    return "GIVEN_UP" if wait_s is None else "FAILED"
