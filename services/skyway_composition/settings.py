"""What composition reads from its environment."""

from typing import Annotated

from pydantic import Field

from skyway.runtime.settings import ServiceSettings


class CompositionSettings(ServiceSettings):
    """`ServiceSettings`, and how much planning may go on at once."""

    port: int = 8002
    #: Threads that plan bookings, and as many again for plans that are only asked for.
    solver_threads: Annotated[int, Field(ge=1, le=64)] = 2
    #: Seconds of wall time after which the search for one plan ends with what it has found.
    solver_time_limit_s: Annotated[float, Field(gt=0)] = 5.0
