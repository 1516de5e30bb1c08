"""The gateway asks composition to delete what it stores of deliveries that ended long ago."""

from typing import Annotated, Final

from pydantic import Field

from skyway.ids import DeliveryId
from skyway.json_model import WireModel

#: Where the gateway asks.
FORGOTTEN_PATH: Final = "/internal/deliveries/forgotten"

#: The most deliveries of one call.
MOST_FORGOTTEN: Final = 200


class ForgetDeliveries(WireModel):
    """The body of POST /internal/deliveries/forgotten; the same call may be repeated."""

    delivery_ids: Annotated[
        tuple[DeliveryId, ...],
        Field(max_length=MOST_FORGOTTEN, description="Deliveries that ended long ago."),
    ]


class KeptDeliveries(WireModel):
    """The answer: the deliveries that are kept for now. All others are deleted."""

    kept: Annotated[
        tuple[DeliveryId, ...],
        Field(description="Deliveries of which something is still needed; ask again later."),
    ] = ()
