"""A provider: its name, its tariff and its terms."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.bounds import Moment, NotNull
from skyway.contracts.candidate import Loading, Standby
from skyway.delivery.offer import Tariff
from skyway.ids import ProviderId
from skyway.json_model import JsonModel

#: A SUSPENDED provider keeps its drones, but they get no new missions.
ProviderState = Literal["ACTIVE", "SUSPENDED"]

ProviderName = Annotated[
    str,
    Field(
        min_length=1,
        max_length=200,
        description="name of the provider",
        examples=["Hill Country Drones"],
    ),
]
Terms = Annotated[str, Field(max_length=10_000, description="terms of delivery, as text")]

_LOADING: Final = (
    "AUTOMATIC: drones load without a person; CONFIRMED: a person weighs and confirms the packages"
)
_STANDBY: Final = (
    "what an idle drone does: HOME: it flies home; STAY: it stays where it delivered; PARKING: it "
    "goes to the best parking station of the network; NEXT_PICKUP: it goes near the next pickup "
    "that is expected from its provider's last requests. A drone may have its own setting"
)
_EXCHANGES: Final = (
    "whether providers that exchange deliveries may fly its own, and its drones may fly theirs, in "
    "networks with `joint_dispatch` and if the customer allows it. The provider that flies a "
    "delivery gets its agreed price, at least what its own tariff asks, and keeps its agreed terms"
)


class NewProvider(JsonModel):
    """A provider to register."""

    name: ProviderName
    tariff: Annotated[Tariff, Field(description="how the provider computes its prices")]
    terms: Annotated[Terms | None, Field(description="terms of delivery, as text")] = None
    loading: Annotated[Loading, Field(description=_LOADING)] = "AUTOMATIC"
    standby: Annotated[Standby, Field(description=_STANDBY)] = "HOME"
    exchanges_deliveries: Annotated[bool, Field(description=_EXCHANGES)] = False


class ProviderChange(JsonModel):
    """Changes of a provider: fields that are left out stay as they are."""

    name: Annotated[ProviderName | None, NotNull, Field(description="new name")] = None
    tariff: Annotated[
        Tariff | None, NotNull, Field(description="new values; those left out stay as they are")
    ] = None
    terms: Annotated[Terms | None, Field(description="new terms; null removes them")] = None
    state: Annotated[
        ProviderState | None,
        NotNull,
        Field(description="only operators change it; SUSPENDED drones get no new missions"),
    ] = None
    loading: Annotated[Loading | None, NotNull, Field(description=_LOADING)] = None
    standby: Annotated[Standby | None, NotNull, Field(description=_STANDBY)] = None
    exchanges_deliveries: Annotated[bool | None, NotNull, Field(description=_EXCHANGES)] = None


class ProviderCard(JsonModel):
    """A provider as customers see it."""

    provider_id: Annotated[ProviderId, Field(description="id of the provider")]
    name: Annotated[str, Field(description="name of the provider")]
    tariff: Annotated[Tariff, Field(description="how the provider computes its prices")]


class Provider(JsonModel):
    """A registered provider."""

    provider_id: Annotated[ProviderId, Field(description="id of the provider")]
    name: Annotated[str, Field(description="name of the provider")]
    tariff: Annotated[Tariff, Field(description="how the provider computes its prices")]
    terms: Annotated[str | None, Field(description="terms of delivery, as text")]
    state: Annotated[
        ProviderState, Field(description="the drones of a SUSPENDED provider get no new missions")
    ]
    loading: Annotated[Loading, Field(description=_LOADING)]
    standby: Annotated[Standby, Field(description=_STANDBY)]
    exchanges_deliveries: Annotated[bool, Field(description=_EXCHANGES)]
    created_at: Annotated[Moment, Field(description="moment of its registration, fleet time")]

    @property
    def card(self) -> ProviderCard:
        """The provider as customers see it."""
        return ProviderCard(provider_id=self.provider_id, name=self.name, tariff=self.tariff)
