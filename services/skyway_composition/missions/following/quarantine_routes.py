"""The quarantine over REST: operators look at set-aside messages, replay and delete them."""

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Query, Response
from pydantic import Field, ValidationError

from skyway.contracts.topics import Topic
from skyway.ids import DroneId, ProviderId, QuarantineId
from skyway.runtime.errors import Conflict, NotFound, ServiceUnavailable
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.moments import earliest_believed, latest_believed
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.sql.database import Database
from skyway_composition.context import Context
from skyway_composition.links.store import link_to
from skyway_composition.missions.following.follow import FOLLOWED_TOPICS, ReportHandler
from skyway_composition.missions.following.plausibility import is_ahead, is_behind
from skyway_composition.quarantine import store
from skyway_composition.quarantine.quarantined import QuarantinedMessage, QuarantineReason
from skyway_composition.quarantine.store import KeptPayload


@dataclass(frozen=True, slots=True)
class Replays:
    """Gives set-aside messages to the handler of drones' messages."""

    context: Context
    handler: ReportHandler
    keys: KeyBook

    async def replay(self, quarantine_id: QuarantineId) -> None:
        """Handle the message; it leaves the quarantine when it was accepted.

        Raises
        ------
        NotFound
            It is not in the quarantine.
        Conflict
            The message still cannot be handled; it stays in the quarantine.
        """
        async with self.context.db.read() as connection:
            kept = await store.payload_of(connection, quarantine_id)
        if kept is None:
            raise NotFound("quarantined message", quarantine_id)
        if not kept.is_whole:
            raise Conflict("PAYLOAD_CUT", "only the begin of this message was kept")
        received = _read(kept.topic, kept.payload)
        await self._refuse_forged(DroneId(received.ids[1]), kept)
        await self._handle(received, first_ms=kept.first_ms)
        async with self.context.db.write() as tx:
            await store.remove(tx, quarantine_id)

    async def _refuse_forged(self, drone_id: DroneId, kept: KeptPayload) -> None:
        await self.keys.look_up([drone_id])
        if self.keys.judge(drone_id, kept.topic, kept.payload) != "PROVEN":
            raise _refusal(f"{drone_id} has not signed it")

    async def _handle(self, received: Received[Any], *, first_ms: int) -> None:
        if is_ahead(received.message, latest_at=latest_believed(self.context.clock)):
            raise _refusal("it speaks of the future")
        if is_behind(received.message, earliest_at=earliest_believed(self.context.clock)):
            raise _refusal("it speaks of long ago")
        drone_id, provider_id = DroneId(received.ids[1]), ProviderId(received.ids[0])
        async with self.context.db.read() as connection:
            link = await link_to(connection, drone_id)
        if link is not None and link.provider_id != provider_id:
            raise _refusal(f"{drone_id} does not belong to {provider_id}")
        is_earlier = (
            link is not None and link.renewed_ms is not None and first_ms <= link.renewed_ms
        )
        if is_earlier and not self.keys.has_key(drone_id):
            raise _refusal(f"{drone_id} has other credentials since, and does not sign")
        try:
            await self.handler.setting_aside_with(_Refusing()).handle([received])
        except (ServiceUnavailable, _StillNotTaken):
            raise
        except Exception as error:
            raise _refusal(f"handling it failed: {type(error).__name__}") from error


class _StillNotTaken(Conflict):
    """Handling has set the message aside again."""


class _Refusing:
    """Sets nothing aside: the message stays where it is, and its sender's level too."""

    def add(self, _received: Received[Any], reason: QuarantineReason, detail: str) -> None:
        """Refuse the message, so that nothing of its handling is written."""
        raise _StillNotTaken("STILL_NOT_TAKEN", f"{reason}: {detail}")

    def suspect(self, ids: tuple[str, ...]) -> None:
        """Note nothing: the drone has not sent the message now."""


def _read(name: str, payload: bytes) -> Received[Any]:
    topic, ids = _topic_of(name)
    try:
        return Received(topic, ids, topic.read(payload), retained=False, payload=payload)
    except ValidationError as error:
        raise _refusal(f"it has {error.error_count()} values that cannot be read") from error


def _topic_of(name: str) -> tuple[Topic[Any], tuple[str, ...]]:
    for topic in FOLLOWED_TOPICS:
        ids = topic.ids_in(name)
        if ids is not None:
            return topic, ids
    raise _refusal(f"nobody reads {name}")


def _refusal(detail: str) -> Conflict:
    return Conflict("STILL_NOT_TAKEN", detail)


class QuarantineQuery(PageQuery):
    """The set-aside messages that a list shows."""

    provider_id: Annotated[
        ProviderId | None,
        Field(description="Only messages under this provider's name; all without it."),
    ] = None


def quarantine_routes(*, db: Database, gate: ServiceGate, replays: Replays) -> ServiceRouter:
    """GET and DELETE /v1/quarantine, and POST /v1/quarantine/{quarantine_id}/replay."""
    router = ServiceRouter(tags=("quarantine",))

    @router.get("/v1/quarantine")
    async def list_quarantine(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[QuarantineQuery, Query()]
    ) -> Page[QuarantinedMessage]:
        """List the messages of drones that were not accepted, the newest first."""
        caller.must_be("operator")
        async with db.read() as connection:
            rows = await store.page(
                connection,
                provider_id=query.provider_id,
                before=query.after_id(),
                limit=query.limit + 1,
            )
        return page_of(
            rows, query, item=lambda each: each, sort_key=lambda each: (each.quarantine_id,)
        )

    @router.post(
        "/v1/quarantine/{quarantine_id}/replay",
        status_code=204,
        responses=conflicts("PAYLOAD_CUT", "STILL_NOT_TAKEN"),
    )
    async def replay_quarantined_message(
        quarantine_id: QuarantineId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Handle a set-aside message now; it leaves the quarantine when it is accepted."""
        caller.must_be("operator")
        await replays.replay(quarantine_id)
        return Response(status_code=204)

    @router.delete("/v1/quarantine/{quarantine_id}", status_code=204)
    async def delete_quarantined_message(
        quarantine_id: QuarantineId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Delete a set-aside message; it was never accepted."""
        caller.must_be("operator")
        async with db.write() as tx:
            is_gone = await store.remove(tx, quarantine_id)
        if not is_gone:
            raise NotFound("quarantined message", quarantine_id)
        return Response(status_code=204)

    return router
