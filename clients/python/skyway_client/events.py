"""Events of a delivery as they arrive on an event stream."""

import json
from typing import Any, Final

import httpx
from httpx_sse import ServerSentEvent

from skyway_client import delivery_events
from skyway_client.call import Call, UnexpectedAnswer
from skyway_client.delivery_events import DeliveryEvent

#: The server sends a comment every 15 s. A stream without any bytes for longer is broken, seconds.
SILENCE_S: Final = 45.0

#: How long a reader waits before it opens a broken stream again, seconds.
REOPEN_AFTER_S: Final = 1.0


def stream_of(delivery_id: str, *, after: int) -> Call[bool]:
    """The call that opens the events after this sequence; it answers whether any may come."""
    return Call(
        method="GET",
        path=f"/v1/deliveries/{delivery_id}/events",
        params={},
        headers={"accept": "text/event-stream", "last-event-id": after},
        body=None,
        takes_idempotency_key=False,
        read=_may_bring_events,
    )


def _may_bring_events(response: httpx.Response) -> bool:
    """Whether events may come; the server answers 204 after the delivery's last event."""
    if response.status_code not in {200, 204}:
        raise UnexpectedAnswer(response)
    return response.status_code == 200


def event_of(members: dict[str, Any]) -> DeliveryEvent | None:
    """The event; None for a type that a newer server added."""
    kind = delivery_events.BY_TYPE.get(members["type"])
    return None if kind is None else kind.from_dict(members)


def event_in(frame: ServerSentEvent) -> DeliveryEvent | None:
    """The event in a frame of the stream; None for a type that a newer server added."""
    return event_of(json.loads(frame.data))
