"""The registry reports the settings with which drones get no deliveries; composition shows them."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.bounds import Words
from skyway.ids import NetworkId, ProviderId
from skyway.json_model import WireModel

#: Where the registry posts them.
BUSINESS_FAULTS: Final = "/internal/business-faults"

#: The most faults of one report. Our own choice.
MOST_FAULTS: Final = 1_000

#: Which setting is at fault. OTHER_CURRENCY is also the reason that a quote gives.
BusinessFaultCode = Literal[
    "HOME_UNKNOWN", "HOME_ISOLATED", "OTHER_CURRENCY", "OTHER_CONNECTOR", "ABOVE_PRICE_CEILING"
]


class BusinessFault(WireModel):
    """Why drones of a provider get no deliveries in a network."""

    provider_id: ProviderId
    network_id: Annotated[NetworkId, Field(description="The network of their homes.")]
    code: Annotated[BusinessFaultCode, Field(description="Which setting, for programs.")]
    detail: Annotated[Words, Field(description="What is wrong and what to change, for people.")]


class BusinessFaults(WireModel):
    """All such faults in the networks of one server: faults that are not named are mended."""

    faults: Annotated[tuple[BusinessFault, ...], Field(max_length=MOST_FAULTS)]
