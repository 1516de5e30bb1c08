"""A provider: its name, its tariff and its terms."""

from typing import Annotated, Literal, TypeVar

from pydantic import AwareDatetime, Field, field_validator

from skyway.contracts.candidate import Loading
from skyway.delivery.offer import Tariff
from skyway.ids import ProviderId
from skyway.json_model import JsonModel

T = TypeVar("T")

#: A SUSPENDED provider keeps its drones, which get no new missions.
ProviderState = Literal["ACTIVE", "SUSPENDED"]

ProviderName = Annotated[str, Field(min_length=1, max_length=200)]
Terms = Annotated[str, Field(max_length=10_000)]


class NewProvider(JsonModel):
    """The body of POST /v1/providers; `loading` CONFIRMED has people weigh what is put on board."""

    name: ProviderName
    tariff: Tariff
    terms: Terms | None = None
    loading: Loading = "AUTOMATIC"


class ProviderChange(JsonModel):
    """The body of PATCH /v1/providers/{id}: what is left out stays as it is."""

    name: ProviderName | None = None
    tariff: Tariff | None = None
    terms: Terms | None = None
    state: ProviderState | None = None
    loading: Loading | None = None

    @field_validator("name", "tariff", "state", "loading")
    @classmethod
    def _stays(cls, value: T | None) -> T:
        if value is None:
            raise ValueError("may be left out, but not null")
        return value


class ProviderCard(JsonModel):
    """What customers see of a provider."""

    provider_id: ProviderId
    name: str
    tariff: Tariff


class Provider(JsonModel):
    """A registered provider."""

    provider_id: ProviderId
    name: str
    tariff: Tariff
    terms: str | None
    state: ProviderState
    loading: Loading
    created_at: Annotated[AwareDatetime, Field(description="RFC 3339 UTC, fleet time")]

    @property
    def card(self) -> ProviderCard:
        """What customers see of it."""
        return ProviderCard(provider_id=self.provider_id, name=self.name, tariff=self.tariff)
