"""What a customer gets back for a cancellation, and for packages that come late."""

from collections.abc import Sequence
from datetime import timedelta
from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from skyway.json_model import JsonModel

#: The most steps of the refund for lateness.
MOST_LATE_STEPS = 10

_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class CancellationTerms(JsonModel):
    """Which share of its price a cancelled mission costs; before it is booked it costs nothing."""

    until_loaded: Annotated[
        _Share,
        Field(
            description="The share of the price if all packages of a booked mission are cancelled "
            "before they are loaded, 0 to 1."
        ),
    ] = 0.0
    in_flight: Annotated[
        _Share,
        Field(
            description="The share of the price if the packages come back because they were "
            "cancelled after loading, 0 to 1; not below `until_loaded`."
        ),
    ] = 1.0

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.in_flight < self.until_loaded:
            raise ValueError(
                f"in_flight {self.in_flight} must not be below until_loaded {self.until_loaded}"
            )
        return self


class LateStep(JsonModel):
    """A share that is given back for a package that comes later than so many minutes."""

    after_min: Annotated[
        int,
        Field(ge=0, le=100_000, description="Minutes after the package's `due_at`, 0 to 100000."),
    ]
    share: Annotated[
        _Share, Field(description="The share of the package's part that is given back, 0 to 1.")
    ]


class WaitingTerms(JsonModel):
    """What it costs that a drone waits for the proof of a hand-over."""

    free_min: Annotated[
        int, Field(ge=0, le=60, description="The first minutes cost nothing, 0 to 60.")
    ] = 0
    per_min: Annotated[
        int,
        Field(
            ge=0,
            le=10**6,
            description="The price of each minute after them that has begun, in minor units, 0 to "
            "1000000.",
        ),
    ] = 0

    def cost_of(self, waited_ms: int) -> int:
        """What a wait costs, in minor units of the tariff's currency."""
        return max(0, -(-waited_ms // 60_000) - self.free_min) * self.per_min


class PaymentTerms(JsonModel):
    """The terms of a price: a booking freezes those of its tariff."""

    cancellation: Annotated[
        CancellationTerms, Field(description="What a cancelled delivery costs.")
    ] = CancellationTerms()
    late: Annotated[
        tuple[LateStep, ...],
        Field(
            max_length=MOST_LATE_STEPS,
            description="What is given back for late packages: steps with rising minutes and "
            "shares, of which the last one that was passed counts. Without steps, nothing.",
        ),
    ] = ()

    waiting: Annotated[
        WaitingTerms | None,
        Field(
            exclude_if=lambda value: value is None,
            description="What it costs that the drone waits for a proof; nothing if null.",
        ),
    ] = None

    @model_validator(mode="after")
    def _late_rises(self) -> Self:
        for before, after in pairwise(self.late):
            if after.after_min <= before.after_min or after.share < before.share:
                raise ValueError("late: each step must have more minutes and no lower share")
        return self

    def late_share(self, later: timedelta) -> float:
        """The share that is given back for a package that comes so much later than its promise."""
        return _last_passed(self.late, later.total_seconds() / 60)


def _last_passed(steps: Sequence[LateStep], late_min: float) -> float:
    return max((step.share for step in steps if late_min > step.after_min), default=0.0)
