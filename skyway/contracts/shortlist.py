"""Registry to gateway to composition: the candidates of a request, in a compact form.

Sixty candidates of a few models and providers pass through three processes for each delivery. So
each model and each provider's terms are sent once. The values that differ between drones are
columns, which the gateway and composition read without making an object for each drone.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, model_validator

from skyway.contracts.candidate import Candidate, Loading, ProviderReason, Standby
from skyway.contracts.message import Soc
from skyway.delivery.offer import Tariff
from skyway.drone.charging import cold_charging_factor
from skyway.drone.learned_values import AS_MODELLED, LearnedValues, model_as_learned
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, ProviderId, StationId
from skyway.json_model import WireModel


class ProviderTerms(WireModel):
    """What holds for every drone of a provider."""

    provider_id: ProviderId
    tariff: Annotated[Tariff, Field(description="How the provider prices a delivery.")]
    loading: Annotated[Loading, Field(description="Who confirms what is loaded.")] = "AUTOMATIC"
    no_shows: Annotated[
        int,
        Field(ge=0, description="Missions of late whose drones did not come; composition counts."),
    ] = 0


class Shortlist(WireModel):
    """The candidates of a request, nearest first: the columns are equally long, a row is a drone.

    The candidates of one model share it, and those of one provider its tariff.
    """

    models: Annotated[
        tuple[DroneModel, ...], Field(description="The drone models of the candidates, once each.")
    ] = ()
    providers: Annotated[
        tuple[ProviderTerms, ...],
        Field(description="The terms of the candidates' providers, once each."),
    ] = ()
    drone_ids: Annotated[tuple[DroneId, ...], Field(description="The drone of each row.")] = ()
    provider_ids: Annotated[
        tuple[ProviderId, ...], Field(description="The provider of each row.")
    ] = ()
    model_ids: Annotated[
        tuple[DroneModelId, ...], Field(description="The drone model of each row.")
    ] = ()
    socs: Annotated[
        tuple[Soc, ...], Field(description="The state of charge of each row, 0 to 1.")
    ] = ()
    station_ids: Annotated[
        tuple[StationId, ...], Field(description="Where the drone of each row stands.")
    ] = ()
    home_station_ids: Annotated[
        tuple[StationId, ...], Field(description="The home of the drone of each row.")
    ] = ()
    standbys: Annotated[
        tuple[Standby, ...],
        Field(description="What the drone of each row does when it is idle."),
    ] = ()
    learned: Annotated[
        tuple[LearnedValues, ...],
        Field(
            description="What flights have shown about the drone of each row; empty if all drones "
            "are as their models say."
        ),
    ] = ()

    @classmethod
    def of(cls, candidates: Iterable[Candidate]) -> Self:
        """The shortlist of these candidates, in their order."""
        listed = tuple(candidates)
        return cls(
            models=tuple({each.model.model_id: each.model for each in listed}.values()),
            providers=tuple(
                {
                    each.provider_id: ProviderTerms(
                        provider_id=each.provider_id,
                        tariff=each.tariff,
                        loading=each.loading,
                        no_shows=each.no_shows,
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
            standbys=tuple(each.standby for each in listed),
            learned=learned_column(each.learned for each in listed),
        )

    @model_validator(mode="after")
    def _rows_are_whole(self) -> Self:
        columns = (self.provider_ids, self.model_ids, self.socs)
        places = (self.station_ids, self.home_station_ids, self.standbys)
        if {len(column) for column in (*columns, *places, self.each_learned)} != {
            len(self.drone_ids)
        }:
            raise ValueError("the columns must be as long as drone_ids")
        if not {model.model_id for model in self.models}.issuperset(self.model_ids):
            raise ValueError("model_ids names a model that is not among the models")
        if not {each.provider_id for each in self.providers}.issuperset(self.provider_ids):
            raise ValueError("provider_ids names a provider that is not among the providers")
        return self

    @property
    def is_empty(self) -> bool:
        """Whether no drone could fly."""
        return not self.drone_ids

    @cached_property
    def model_of(self) -> Mapping[DroneModelId, DroneModel]:
        """The models by their ids."""
        return {model.model_id: model for model in self.models}

    @cached_property
    def terms_of(self) -> Mapping[ProviderId, ProviderTerms]:
        """The providers' terms by their ids."""
        return {each.provider_id: each for each in self.providers}

    @cached_property
    def each_learned(self) -> tuple[LearnedValues, ...]:
        """The learned values of each row, also if all drones are as their models say."""
        return self.learned or tuple(AS_MODELLED for _ in self.drone_ids)

    @cached_property
    def kinds(self) -> tuple[Hashable, ...]:
        """A key of each row's model and learned values; rows with equal keys fly and charge alike.

        It is the model's id where no drone has learned values: all composing looks it up.
        """
        if not self.learned:
            return self.model_ids
        return tuple(zip(self.model_ids, self.learned, strict=True))

    @cached_property
    def planned_model_of(self) -> Mapping[Hashable, DroneModel]:
        """The models that flights are planned with, by their kinds."""
        if not self.learned:
            models: dict[Hashable, DroneModel] = dict(self.model_of.items())
            return models
        rows = {kind: row for row, kind in enumerate(self.kinds)}
        return {
            kind: model_as_learned(self.model_of[self.model_ids[row]], self.learned[row])
            for kind, row in rows.items()
        }

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones one by one, nearest first."""
        return tuple(self.candidate(row) for row in range(len(self.drone_ids)))

    def candidate(self, row: int) -> Candidate:
        """The drone of one row."""
        terms = self.terms_of[self.provider_ids[row]]
        return Candidate(
            provider_id=terms.provider_id,
            drone_id=self.drone_ids[row],
            model=self.model_of[self.model_ids[row]],
            soc=self.socs[row],
            station_id=self.station_ids[row],
            home_station_id=self.home_station_ids[row],
            standby=self.standbys[row],
            tariff=terms.tariff,
            loading=terms.loading,
            no_shows=terms.no_shows,
            learned=self.each_learned[row],
        )

    def only(self, rows: Sequence[int]) -> Self:
        """The shortlist of these rows, in their order."""
        if [*rows] == [*range(len(self.drone_ids))]:
            return self
        return type(self)(
            models=self.models,
            providers=self.providers,
            drone_ids=tuple(self.drone_ids[row] for row in rows),
            provider_ids=tuple(self.provider_ids[row] for row in rows),
            model_ids=tuple(self.model_ids[row] for row in rows),
            socs=tuple(self.socs[row] for row in rows),
            station_ids=tuple(self.station_ids[row] for row in rows),
            home_station_ids=tuple(self.home_station_ids[row] for row in rows),
            standbys=tuple(self.standbys[row] for row in rows),
            learned=learned_column(self.each_learned[row] for row in rows),
        )

    def in_cold(self, temperature_c: float | None) -> Self:
        """The shortlist in air of this temperature: in the cold all drones charge more slowly.

        None is a temperature that is not known.
        """
        if temperature_c is None or cold_charging_factor(temperature_c) <= 1:
            return self
        learned = {each: each.in_cold(temperature_c) for each in set(self.each_learned)}
        return self._with(learned=learned_column(learned[each] for each in self.each_learned))

    def with_tariff(self, provider_id: ProviderId, tariff: Tariff) -> Self:
        """The shortlist with another tariff of this provider."""
        if provider_id not in self.terms_of:
            return self
        return self._with_terms({provider_id: {"tariff": tariff}})

    def with_no_shows(self, counts: Mapping[ProviderId, int]) -> Self:
        """The shortlist with the no-shows of its providers; a provider without a count has none."""
        changes = {each: {"no_shows": counts[each]} for each in self.terms_of if each in counts}
        return self._with_terms(changes) if changes else self

    def _with_terms(self, changes: Mapping[ProviderId, Mapping[str, object]]) -> Self:
        providers = tuple(
            each.model_copy(update=changes.get(each.provider_id, {})) for each in self.providers
        )
        return self._with(providers=providers)

    def _with(self, **changes: object) -> Self:
        # Not `model_copy`: the copy would keep the terms that `terms_of` has cached.
        columns = {name: getattr(self, name) for name in type(self).model_fields}
        return type(self)(**{**columns, **changes})

    def of_provider(self, provider_id: ProviderId) -> Self:
        """The shortlist of one provider's drones."""
        return self.only([row for row, of in enumerate(self.provider_ids) if of == provider_id])


def learned_column(values: Iterable[LearnedValues]) -> tuple[LearnedValues, ...]:
    """The column `learned` of a shortlist; empty if it says nothing."""
    column = tuple(values)
    # Most are the same object: comparing costs more.
    says_something = any(each is not AS_MODELLED and each != AS_MODELLED for each in column)
    return column if says_something else ()


class Candidates(WireModel):
    """The registry's answer: the drones to compare, and the providers that have none.

    The providers in `more_later` have, beside those to compare, drones that could fly it once they
    are free again or charged.
    """

    shortlist: Annotated[Shortlist, Field(description="The drones that could fly the request.")]
    infeasible: Annotated[
        tuple[ProviderReason, ...], Field(description="Why the other providers have none.")
    ]
    more_later: Annotated[
        tuple[ProviderId, ...],
        Field(description="Whether busy or silent drones may be free later."),
    ] = ()


class CandidateLists(WireModel):
    """The registry's answer about several requests, from one state of the fleets."""

    answers: Annotated[
        tuple[Candidates, ...], Field(description="One answer for each question, in their order.")
    ]
