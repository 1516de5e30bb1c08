"""Registry to gateway to composition: the candidates of a request, in the form that travels.

Sixty candidates of a few models and providers pass through three processes for each delivery. So
each model and each provider's terms come once, and what differs from drone to drone in columns,
which the gateway reads and writes without making a value of each.
"""

from collections.abc import Iterable
from functools import cached_property
from typing import Self

from pydantic import model_validator

from skyway.contracts.candidate import Candidate, Loading, ProviderReason
from skyway.contracts.message import Soc
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, ProviderId, StationId
from skyway.json_model import WireModel


class ProviderTerms(WireModel):
    """What holds for every drone of a provider."""

    provider_id: ProviderId
    tariff: Tariff
    loading: Loading = "AUTOMATIC"


class Shortlist(WireModel):
    """The candidates of a request, nearest first: the columns are equally long, a row is a drone.

    The candidates of one model share it, and those of one provider its tariff.
    """

    models: tuple[DroneModel, ...] = ()
    providers: tuple[ProviderTerms, ...] = ()
    drone_ids: tuple[DroneId, ...] = ()
    provider_ids: tuple[ProviderId, ...] = ()
    model_ids: tuple[DroneModelId, ...] = ()
    socs: tuple[Soc, ...] = ()
    station_ids: tuple[StationId, ...] = ()
    home_station_ids: tuple[StationId, ...] = ()

    @classmethod
    def of(cls, candidates: Iterable[Candidate]) -> Self:
        """The shortlist of these candidates, in their order."""
        listed = tuple(candidates)
        return cls(
            models=tuple({each.model.model_id: each.model for each in listed}.values()),
            providers=tuple(
                {
                    each.provider_id: ProviderTerms(
                        provider_id=each.provider_id, tariff=each.tariff, loading=each.loading
                    )
                    for each in listed
                }.values()
            ),
            drone_ids=tuple(each.drone_id for each in listed),
            provider_ids=tuple(each.provider_id for each in listed),
            model_ids=tuple(each.model.model_id for each in listed),
            socs=tuple(each.soc for each in listed),
            station_ids=tuple(each.station_id for each in listed),
            home_station_ids=tuple(each.home_station_id for each in listed),
        )

    @model_validator(mode="after")
    def _rows_are_whole(self) -> Self:
        columns = (self.provider_ids, self.model_ids, self.socs)
        places = (self.station_ids, self.home_station_ids)
        if {len(column) for column in (*columns, *places)} != {len(self.drone_ids)}:
            raise ValueError("the columns must be as long as drone_ids")
        if not {model.model_id for model in self.models}.issuperset(self.model_ids):
            raise ValueError("model_ids names a model that is not among the models")
        if not {each.provider_id for each in self.providers}.issuperset(self.provider_ids):
            raise ValueError("provider_ids names a provider that is not among the providers")
        return self

    @property
    def is_empty(self) -> bool:
        """Whether nobody could fly."""
        return not self.drone_ids

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Each drone by itself, nearest first."""
        models = {model.model_id: model for model in self.models}
        terms = {each.provider_id: each for each in self.providers}
        return tuple(
            Candidate(
                provider_id=provider_id,
                drone_id=drone_id,
                model=models[model_id],
                soc=soc,
                station_id=station_id,
                home_station_id=home_station_id,
                tariff=terms[provider_id].tariff,
                loading=terms[provider_id].loading,
            )
            for drone_id, provider_id, model_id, soc, station_id, home_station_id in zip(
                self.drone_ids,
                self.provider_ids,
                self.model_ids,
                self.socs,
                self.station_ids,
                self.home_station_ids,
                strict=True,
            )
        )


class Candidates(WireModel):
    """The registry's answer: the drones to compare, and the providers that have none."""

    shortlist: Shortlist
    infeasible: tuple[ProviderReason, ...]
