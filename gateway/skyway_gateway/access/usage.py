"""What the caller may use, and what is left of it, as GET /v1/limits shows it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol

from pydantic import Field

from skyway.contracts.drones import DroneQuota
from skyway.ids import ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller
from skyway.runtime.limits import Reading, Slots


class UsageBudget(JsonModel):
    """A budget that refills with time; each replica of the gateway counts by itself."""

    code: Annotated[str, Field(description="Its name, as a 429 answer has it in `code`.")]
    per_s: Annotated[float, Field(description="What it refills by, a second of wall time.")]
    burst: Annotated[int, Field(description="The most that is there at any moment.")]
    left: Annotated[int, Field(description="What is there now.")]
    full_after_s: Annotated[
        float, Field(description="Seconds of wall time until all of it is there again.")
    ]

    @classmethod
    def of(cls, reading: Reading) -> "UsageBudget":
        """The budget as a meter reads it."""
        return cls(
            code=reading.budget.code,
            per_s=reading.budget.per_s,
            burst=reading.budget.burst,
            left=reading.left,
            full_after_s=round(reading.full_after_s, 3),
        )


class UsageQuota(JsonModel):
    """How many things of a kind the caller may have at the same time."""

    code: Annotated[str, Field(description="The `code` of the answer that refuses one more.")]
    most: Annotated[int, Field(description="How many it may have.")]
    used: Annotated[int, Field(description="How many it has.")]


class Limits(JsonModel):
    """What the caller may use, and what is left of it."""

    budgets: Annotated[
        tuple[UsageBudget, ...], Field(description="The budgets that refill with time.")
    ]
    quotas: Annotated[
        tuple[UsageQuota, ...], Field(description="What the caller may have at the same time.")
    ]


class UsageCounter(Protocol):
    """Counts things that callers have."""

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """What the caller has; nothing for a role that has none of these things."""
        ...


class DroneCounts(Protocol):
    """The registry, which limits the drones of each provider."""

    async def drone_quota(self, provider_id: ProviderId) -> DroneQuota:
        """How many drones the provider may have, and has."""
        ...


@dataclass(frozen=True, slots=True)
class DroneUsage:
    """Counts the drones of a provider."""

    registry: DroneCounts

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """The drones of a provider."""
        if caller.role != "provider":
            return ()
        quota = await self.registry.drone_quota(ProviderId(caller.subject_id))
        return (UsageQuota(code="TOO_MANY_DRONES", most=quota.most, used=quota.used),)


class LiveViews(Protocol):
    """The live picture, which limits the parts of it that a customer or provider follows."""

    @property
    def most_views(self) -> int:
        """How many different parts each may follow together."""
        ...

    def views_of(self, role: str, subject_id: str) -> Sequence[object]:
        """The parts that this viewer follows."""
        ...


@dataclass(frozen=True, slots=True)
class ViewUsage:
    """Counts the parts of the live picture that a caller follows at this replica."""

    live: LiveViews

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """The parts that a customer or provider follows; operators have no limit."""
        if caller.role not in ("customer", "provider"):
            return ()
        used = len(self.live.views_of(caller.role, caller.subject_id))
        return (UsageQuota(code="LIVE_VIEWS", most=self.live.most_views, used=used),)


@dataclass(frozen=True, slots=True)
class StreamUsage:
    """Counts the event streams that a caller has open at this replica."""

    slots: Slots

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """The open streams of the caller; drones have none."""
        if caller.role == "drone":
            return ()
        used = self.slots.used(str(caller))
        return (UsageQuota(code=self.slots.code, most=self.slots.most, used=used),)
