"""How many requests wait for a drone now, by how long they have waited."""

from collections.abc import Mapping
from typing import Annotated, Final

from pydantic import Field

from skyway.json_model import JsonModel

#: The upper ends of the ages, fleet seconds: a minute, 5, 15 and 60 minutes. Our own choice.
AGES_S: Final = (60, 300, 900, 3600)


class WaitingAge(JsonModel):
    """The requests of one age: older than the age before, and at most `up_to_s`."""

    up_to_s: Annotated[
        float | None, Field(description="Upper end of the age, seconds; null means no end.")
    ]
    requests: Annotated[int, Field(description="How many requests have waited this long.")]


class WaitingRequests(JsonModel):
    """The requests that no drone could serve yet. Their ages are in fleet time."""

    requests: Annotated[int, Field(description="How many requests wait for a drone now.")]
    oldest_s: Annotated[
        float | None, Field(description="How long the oldest has waited; null if none waits.")
    ]
    by_age: Annotated[
        tuple[WaitingAge, ...], Field(description="The requests by age, the newest first.")
    ]


def waiting_requests(
    by_age: Mapping[float | None, int], *, oldest_s: float | None
) -> WaitingRequests:
    """The answer, from the number of requests by the upper end of their age."""
    return WaitingRequests(
        requests=sum(by_age.values()),
        oldest_s=oldest_s,
        by_age=tuple(
            WaitingAge(up_to_s=up_to_s, requests=by_age.get(up_to_s, 0))
            for up_to_s in (*AGES_S, None)
        ),
    )
