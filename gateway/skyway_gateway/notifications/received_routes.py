"""The calls that customers' webhooks receive, as the OpenAPI document shows them.

Nothing here is ever called: `sender` makes these calls.
"""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, Header, Response

from skyway.contracts.delivery_event_examples import delivery_event_examples
from skyway.contracts.delivery_event_forms import AnyDeliveryEvent
from skyway.runtime.http.service_router import operation_id
from skyway_gateway.notifications.webhooks.webhook import TrialEvent

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
        "Webhooks), with the secret of the webhook.",
    ),
]


DELIVERY_EVENT: Final = "delivery-event"


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

    @router.post("webhook-test", responses=_ANSWERS, response_class=Response)
    def receive_test_event(
        webhook_id: _Id,
        webhook_timestamp: _Timestamp,
        webhook_signature: _Signature,
        event: TrialEvent,
    ) -> None:
        """The event that `POST /v1/webhooks/{webhook_id}/test` sends."""

    return router
