"""What a network's `settings` member may hold, and what holds without it."""

from typing import Annotated

from pydantic import Field, ValidationError

from skyway.contracts.mission import Margins
from skyway.delivery.offer import Currency
from skyway.delivery.request import MAX_TRIP_DESTINATIONS
from skyway.errors import InvalidNetwork
from skyway.json_model import JsonModel
from skyway.network.network import Network

#: Loading and handing over take no longer than a day; a typing mistake does.
_LONGEST_STOP_S = 86_400.0


class NetworkSettings(JsonModel):
    """The currency of all prices in a network, how long people need, and the margins of plans.

    `energy_margin` is added to what flights take, `pad_gap_s` lies between two drones on a pad. A
    drone may be late by `tolerated_lateness_s` before its plan is made anew. All of these are our
    own choices where a network says nothing.
    """

    currency: Currency = "USD"
    loading_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 60.0
    dropoff_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 30.0
    energy_margin: Annotated[float, Field(ge=0, le=2)] = 0.15
    pad_gap_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 120.0
    tolerated_lateness_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 120.0
    recipient_wait_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 300.0
    loading_timeout_s: Annotated[float, Field(gt=0, le=7 * _LONGEST_STOP_S)] = 1_800.0
    max_destinations_per_trip: Annotated[int, Field(ge=1, le=MAX_TRIP_DESTINATIONS)] = 8

    @property
    def margins(self) -> Margins:
        """What plans in this network are booked with, as offers and missions show it."""
        return Margins(
            energy_margin=self.energy_margin,
            pad_gap_s=self.pad_gap_s,
            tolerated_lateness_s=self.tolerated_lateness_s,
        )


def settings_of(network: Network) -> NetworkSettings:
    """The settings of this network.

    Raises
    ------
    InvalidNetwork
        A setting is unknown, or breaks its limit; the error names it.
    """
    try:
        return NetworkSettings.model_validate(dict(network.settings))
    except ValidationError as error:
        fault = error.errors()[0]
        name = ".".join(str(part) for part in ("settings", *fault["loc"]))
        raise InvalidNetwork(name, fault["msg"]) from error
