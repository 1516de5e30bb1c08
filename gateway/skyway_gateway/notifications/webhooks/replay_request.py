"""Which past events a customer wants again."""

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from skyway.contracts.message import WallMoment
from skyway.ids import DeliveryId, EventId
from skyway.json_model import JsonModel

#: The most events that a call may name by id, and the most that it queues.
_MOST_NAMED: Final = 100
MOST_EVENTS: Final = 10_000


class ReplayRequest(JsonModel):
    """The named events, all events of a delivery, or all that were recorded in [from, to).

    For a delivery or a span, only event types that the webhook subscribes to are sent.
    """

    event_ids: Annotated[
        Annotated[tuple[EventId, ...], Field(min_length=1, max_length=_MOST_NAMED)] | None,
        Field(description="The events to send again, 1 to 100."),
    ] = None
    delivery_id: Annotated[DeliveryId | None, Field(description="All events of this delivery.")] = (
        None
    )
    from_at: Annotated[
        WallMoment | None,
        Field(alias="from", description="All events recorded at this moment or later, wall time."),
    ] = None
    to_at: Annotated[
        WallMoment | None,
        Field(
            alias="to",
            description="With `from`: only events recorded before this moment, wall time.",
        ),
    ] = None

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        given = [self.event_ids is not None, self.delivery_id is not None, self.from_at is not None]
        if sum(given) != 1:
            raise ValueError("give one of event_ids, delivery_id and from")
        if self.to_at is not None and (self.from_at is None or self.to_at <= self.from_at):
            raise ValueError("to must come with from, and after it")
        return self


class Replay(JsonModel):
    """How many events were queued again; events that were still pending are not counted."""

    queued: Annotated[int, Field(ge=0, description="How many events were queued again.")]
