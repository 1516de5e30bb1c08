"""A network as it is published, with the settings in its `settings` member."""

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field, ValidationError

from skyway.complaints import fault_of
from skyway.contracts.margins import Margins
from skyway.delivery.offer import Currency
from skyway.delivery.request import MAX_TRIP_DESTINATIONS, Package
from skyway.errors import InvalidNetwork
from skyway.json_model import JsonModel
from skyway.network.geojson_schema import NetworkGeoJson
from skyway.network.network import Network

#: One day: a longer time to load or to hand over is a typing mistake.
_LONGEST_STOP_S = 86_400.0

#: In minor units; a higher price is a typing mistake.
_HIGHEST_PRICE = 10**12


class NetworkSettings(JsonModel):
    """The currency of all prices in a network, how long people need, and the margins of plans.

    All defaults are our own choices.
    """

    currency: Annotated[Currency, Field(description="Currency of all prices in the network.")] = (
        "USD"
    )
    price_ceiling: Annotated[
        int | None,
        Field(
            ge=0,
            le=_HIGHEST_PRICE,
            description="The most that one booking for a request without `max_price` may cost, in "
            "minor units. Quotes show dearer drones, and a customer may accept their offers. No "
            "limit if null.",
        ),
    ] = None
    loading_s: Annotated[
        float,
        Field(
            ge=0,
            le=_LONGEST_STOP_S,
            description="Planned time to load a drone, seconds, 0 to one day.",
        ),
    ] = 60.0
    dropoff_s: Annotated[
        float,
        Field(
            ge=0,
            le=_LONGEST_STOP_S,
            description="Planned time to hand over at a destination, seconds, 0 to one day.",
        ),
    ] = 30.0
    proof_s: Annotated[
        float,
        Field(
            ge=0,
            le=600,
            description="Planned time to wait for the proof of a hand-over, seconds, 0 to 600. It "
            "is added to `dropoff_s` if some package of the request needs a proof.",
        ),
    ] = 30.0
    energy_margin: Annotated[
        float,
        Field(
            ge=0,
            le=2,
            description="Share of energy that plans add to what flights need, 0 to 2.",
        ),
    ] = 0.15
    reserve_risk: Annotated[
        float | None,
        Field(
            ge=1e-6,
            le=0.2,
            description="Accepted share of landings below the reserve, 0.000001 to 0.2. The energy "
            "margin of each flight follows from it, and `energy_margin` does not count. If null, "
            "`energy_margin` counts.",
            examples=[0.001],
        ),
    ] = None
    pad_gap_s: Annotated[
        float,
        Field(
            ge=0,
            le=_LONGEST_STOP_S,
            description="Planned gap between two drones on one pad, seconds, 0 to one day.",
        ),
    ] = 120.0
    tolerated_lateness_s: Annotated[
        float,
        Field(
            ge=0,
            le=_LONGEST_STOP_S,
            description="How late a drone may be without a new plan, seconds, 0 to one day.",
        ),
    ] = 120.0
    recipient_wait_s: Annotated[
        float,
        Field(
            ge=0,
            le=_LONGEST_STOP_S,
            description="How long a drone waits for a recipient, seconds, 0 to one day.",
        ),
    ] = 300.0
    loading_timeout_s: Annotated[
        float,
        Field(
            gt=0,
            le=7 * _LONGEST_STOP_S,
            description="How long a drone waits for a confirmation that it is loaded, seconds, "
            "at most seven days.",
        ),
    ] = 1_800.0
    max_destinations_per_trip: Annotated[
        int,
        Field(
            ge=1,
            le=MAX_TRIP_DESTINATIONS,
            description="The most destinations of one drone's trip.",
        ),
    ] = 8

    joint_dispatch: Annotated[
        bool,
        Field(
            description="Whether the dispatcher plans the drones of all providers together that "
            "exchange deliveries (`exchanges_deliveries`)."
        ),
    ] = False

    def hand_over_s(self, packages: Iterable[Package]) -> float:
        """Planned time of each hand-over if these packages are delivered on one trip, seconds."""
        needs_proof = any(each.dropoff_verification is not None for each in packages)
        return self.dropoff_s + (self.proof_s if needs_proof else 0.0)

    @property
    def margins(self) -> Margins:
        """The margins of plans in this network; a `reserve_risk` changes that of energy."""
        return Margins(
            energy_margin=self.energy_margin,
            pad_gap_s=self.pad_gap_s,
            tolerated_lateness_s=self.tolerated_lateness_s,
        )


class NetworkDocument(NetworkGeoJson):
    """A skyway network as a GeoJSON FeatureCollection (RFC 7946), with its settings."""

    settings: Annotated[
        NetworkSettings,
        Field(description="Currency, times and margins; each has a default if it is missing."),
    ] = NetworkSettings()


def settings_of(network: Network, *above: str) -> NetworkSettings:
    """The settings of this network; `above` are the fields that hold it in the document.

    Raises
    ------
    InvalidNetwork
        A setting is unknown or breaks its limit; the error names the setting.
    """
    try:
        return NetworkSettings.model_validate(dict(network.settings))
    except ValidationError as error:
        raise InvalidNetwork(*fault_of(error.errors()[0], *above, "settings")) from error
