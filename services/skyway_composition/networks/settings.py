"""What a network's `settings` member may hold, and what holds without it."""

from typing import Annotated

from pydantic import Field, ValidationError

from skyway.delivery.offer import Currency
from skyway.errors import InvalidNetwork
from skyway.json_model import JsonModel
from skyway.network.network import Network

#: Loading and handing over take no longer than a day; a typing mistake does.
_LONGEST_STOP_S = 86_400.0


class NetworkSettings(JsonModel):
    """The currency of all prices in a network, and how long people need at a drone."""

    currency: Currency = "USD"
    #: Our own choice: a minute to load and half of one to hand over.
    loading_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 60.0
    dropoff_s: Annotated[float, Field(ge=0, le=_LONGEST_STOP_S)] = 30.0


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
