"""The QoS that annotates a delivery request: what makes an offer best, limits, and permissions."""

from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from skyway.bounds import Moment
from skyway.ids import ProviderId
from skyway.json_model import JsonModel

Objective = Literal["FASTEST", "CHEAPEST", "GREENEST"]

#: Which arrival time is promised: the moment by which nine of ten packages come, or half of them.
PromiseLevel = Literal["P90", "P50"]

#: The classes of requests.
Priority = Literal["PRIORITY", "STANDARD"]

#: The order of the classes: a lower rank is planned first.
PRIORITY_RANKS: Final[Mapping[Priority, int]] = {"PRIORITY": 0, "STANDARD": 1}

#: The most metres to another station where packages may be handed over. At a walk of 5 km/h this is
#: an hour. Our own choice.
FURTHEST_PICKUP_M: Final = 5_000.0


class Weights(JsonModel):
    """How much time, price and energy count; only their proportions matter."""

    time: Annotated[
        float, Field(ge=0, le=1_000, description="How much the delivery time counts, 0 to 1000.")
    ] = 0.0
    price: Annotated[
        float, Field(ge=0, le=1_000, description="How much the price counts, 0 to 1000.")
    ] = 0.0
    energy: Annotated[
        float, Field(ge=0, le=1_000, description="How much the energy counts, 0 to 1000.")
    ] = 0.0

    @model_validator(mode="after")
    def _something_counts(self) -> Self:
        if self.time + self.price + self.energy == 0:
            raise ValueError("at least one of time, price and energy must be above 0")
        return self


class ProviderChoice(JsonModel):
    """Which providers may serve: one pinned, only those allowed, none of those denied."""

    pinned: Annotated[ProviderId | None, Field(description="The only provider that may serve.")] = (
        None
    )
    allowed: Annotated[
        Annotated[tuple[ProviderId, ...], Field(max_length=100)] | None,
        Field(description="The providers that may serve; all if null."),
    ] = None
    denied: Annotated[
        Annotated[tuple[ProviderId, ...], Field(max_length=100)] | None,
        Field(description="The providers that may not serve."),
    ] = None

    def admits(self, provider_id: ProviderId) -> bool:
        """Whether this provider may serve."""
        if self.pinned is not None and provider_id != self.pinned:
            return False
        if self.allowed is not None and provider_id not in self.allowed:
            return False
        return provider_id not in (self.denied or ())

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.pinned is not None and not self.admits(self.pinned):
            raise ValueError(f"pinned provider {self.pinned!r} is denied, or not among the allowed")
        both = set(self.allowed or ()) & set(self.denied or ())
        if both:
            raise ValueError(f"provider {min(both)!r} is both allowed and denied")
        return self


class QoS(JsonModel):
    """What the customer asks for: `objective` or `weights` rank offers, the limits are hard.

    `max_price` is in minor units of the network's currency. PRIORITY requests are planned before
    STANDARD ones, and cost more.
    """

    objective: Annotated[
        Objective | None,
        Field(description="What makes an offer best; `FASTEST` without `weights`."),
    ] = None
    weights: Annotated[
        Weights | None,
        Field(description="How much time, price and energy count, instead of an objective."),
    ] = None
    deadline_at: Annotated[
        Moment | None,
        Field(description="The last delivery must be over by then, RFC 3339 UTC, fleet time."),
    ] = None
    max_price: Annotated[
        Annotated[int, Field(ge=0, le=2**63 - 1)] | None,
        Field(description="The most that it may cost, in minor units."),
    ] = None
    providers: Annotated[ProviderChoice, Field(description="Which providers may serve.")] = (
        ProviderChoice()
    )
    priority: Annotated[
        Priority,
        Field(description="PRIORITY is planned first, at the tariff's `priority_factor`."),
    ] = "STANDARD"
    promise: Annotated[
        PromiseLevel,
        Field(
            description="Which arrival time is promised: P90, by which nine of ten packages come, "
            "or P50, the time of the plan. P50 is promised too while no P90 is known."
        ),
    ] = "P90"
    pooling: Annotated[
        bool,
        Field(
            description="Whether the drone may carry packages of other deliveries on this trip; "
            "then each pays its `pooled_price`. A request with windows or a deadline flies alone.",
        ),
    ] = False
    pooling_wait_s: Annotated[
        float,
        Field(ge=0, le=3600, description="Seconds that the start is delayed for others to join."),
    ] = 0.0
    pickup_within_m: Annotated[
        float,
        Field(
            ge=0,
            le=FURTHEST_PICKUP_M,
            description="Metres, in a straight line, from the pickup to other stations where the "
            "packages may be handed over to share a trip; 0 to 5000. It needs `pooling`. The "
            "delivery's `pickup` says which station it is.",
        ),
    ] = 0.0
    may_be_later_s: Annotated[
        float,
        Field(
            ge=0,
            le=14_400,
            description="Seconds by which the delivery may come later than first planned, so that "
            "the dispatcher can plan the whole fleet better. They are added to `due_at`.",
        ),
    ] = 0.0
    firm_within_s: Annotated[
        float,
        Field(
            ge=0,
            le=3600,
            description="Seconds after the booking within which the promise becomes firm; 0 to "
            "3600. Until then it is provisional: the dispatcher may plan the delivery at any time "
            "up to its deadline.",
        ),
    ] = 0.0

    may_change_provider: Annotated[
        bool,
        Field(
            description="Whether another provider may fly the delivery, if `providers` admits it "
            "and a better plan of all fleets follows. Price, terms and promise stay as they are.",
        ),
    ] = False

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.objective is not None and self.weights is not None:
            raise ValueError("objective and weights exclude each other: give one of them")
        if self.pooling_wait_s > 0 and not self.pooling:
            raise ValueError("pooling_wait_s needs pooling: true")
        if self.pickup_within_m > 0 and not self.pooling:
            raise ValueError("pickup_within_m needs pooling: true")
        return self

    @property
    def ranking(self) -> Weights:
        """The weights by which offers are ranked; the fastest when nothing is asked."""
        if self.weights is not None:
            return self.weights
        by_objective = {
            "FASTEST": Weights(time=1),
            "CHEAPEST": Weights(price=1),
            "GREENEST": Weights(energy=1),
        }
        return by_objective[self.objective or "FASTEST"]
