"""The providers and drones of the sandbox, which no registry knows."""

from dataclasses import dataclass
from typing import Final

from skyway.contracts.candidate import (
    Candidate,
    CandidateQueries,
    CandidateQuery,
    PayloadLimit,
    PayloadLimitQuery,
    ProviderReason,
    ProviderReasonCode,
)
from skyway.contracts.shortlist import CandidateLists, Candidates, Shortlist
from skyway.delivery.offer import Tariff
from skyway.delivery.payment_terms import CancellationTerms, LateStep, PaymentTerms
from skyway.drone.cargo import misfit
from skyway.drone.models import PAPER_MATRICE_300
from skyway.ids import DroneId, ProviderId
from skyway_gateway.sandbox.network import HUB


@dataclass(frozen=True, slots=True)
class SandboxProvider:
    """A provider of the sandbox, whose drones stand at the hub."""

    provider_id: ProviderId
    name: str
    tariff: Tariff

    @property
    def drone_ids(self) -> tuple[DroneId, ...]:
        """Its drones: another one flies when the first one refuses."""
        word = self.provider_id.rpartition("_")[2]
        return tuple(DroneId(f"drn_test_{word}_{number}") for number in (1, 2))


#: What both providers give back: half before loading, and a quarter of a package an hour late.
_TERMS: Final = PaymentTerms(
    cancellation=CancellationTerms(until_loaded=0.5, in_flight=1.0),
    late=(LateStep(after_min=15, share=0.1), LateStep(after_min=45, share=0.25)),
)

PROVIDERS: Final = (
    SandboxProvider(
        ProviderId("prv_test_swift"),
        "Sandbox Swift",
        Tariff(base=500, per_km=40, per_kg=100, minimum=600, payment_terms=_TERMS),
    ),
    SandboxProvider(
        ProviderId("prv_test_thrift"),
        "Sandbox Thrift",
        Tariff(base=300, per_km=60, per_kg=80, minimum=400, payment_terms=_TERMS),
    ),
)

MODEL: Final = PAPER_MATRICE_300


class SandboxRegistry:
    """`Registry` of the sandbox: its drones are always free, charged and at the hub."""

    async def candidates(self, query: CandidateQuery) -> Candidates:
        """The drones that can carry the packages, and why the other providers have none."""
        reason = _reason(query)
        able, infeasible = list[Candidate](), list[ProviderReason]()
        for provider in PROVIDERS:
            if not query.providers.admits(provider.provider_id):
                infeasible.append(_why_not(provider, "NOT_ADMITTED", "the request excludes it"))
            elif reason is not None:
                infeasible.append(_why_not(provider, *reason))
            else:
                free = (each for each in provider.drone_ids if each not in query.excluded_drone_ids)
                able += [_candidate(provider, each) for each in free]
        return Candidates(shortlist=Shortlist.of(able), infeasible=tuple(infeasible))

    async def candidate_lists(self, asked: CandidateQueries) -> CandidateLists:
        """The same for several requests."""
        return CandidateLists(
            answers=tuple([await self.candidates(each) for each in asked.queries])
        )

    async def payload_limit(self, query: PayloadLimitQuery) -> PayloadLimit:
        """The payload of the only model, unless no provider is admitted."""
        choice, known = query.providers, {each.provider_id for each in PROVIDERS}
        named = (choice.pinned, *(choice.allowed or ()), *(choice.denied or ()))
        is_any = any(choice.admits(each) for each in known)
        return PayloadLimit(
            max_payload_kg=MODEL.max_payload_kg if is_any else None,
            drone_model_id=MODEL.model_id if is_any else None,
            unknown_provider_ids=tuple(each for each in named if each and each not in known),
        )


def _reason(query: CandidateQuery) -> tuple[ProviderReasonCode, str] | None:
    """Why no drone of the sandbox can carry the packages; all have the same model."""
    limit_kg = MODEL.max_payload_kg
    if query.payload_kg > limit_kg:
        return "OVERWEIGHT", (
            f"{query.payload_kg:g} kg exceed the {limit_kg:g} kg limit of drone model "
            f"{MODEL.model_id}, and the sandbox does not split deliveries over several drones"
        )
    wrong = misfit(MODEL, query.packages)
    return None if wrong is None else (wrong.code, wrong.detail)


def _why_not(provider: SandboxProvider, code: ProviderReasonCode, detail: str) -> ProviderReason:
    return ProviderReason(
        provider_id=provider.provider_id, code=code, detail=detail, is_temporary=False
    )


def _candidate(provider: SandboxProvider, drone_id: DroneId) -> Candidate:
    return Candidate(
        provider_id=provider.provider_id,
        drone_id=drone_id,
        model=MODEL,
        soc=1.0,
        station_id=HUB.station_id,
        home_station_id=HUB.station_id,
        tariff=provider.tariff,
    )
