"""Doubt about a mission: nobody knows what its drone has done."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.json_model import WireModel


class Doubt(WireModel):
    """Why nobody knows whether the drone flies, or has flown, its mission.

    The mission keeps its drone, its pads and its packages until the drone reports what happened or
    an operator gives the mission up: no other drone may get the packages meanwhile.
    """

    code: Annotated[
        Literal["NO_ANSWER", "SILENT", "JOURNAL_LOST"],
        Field(
            description="NO_ANSWER: the drone did not answer the booking, and may have accepted "
            "it. SILENT: the drone has sent no message since long after the planned end. "
            "JOURNAL_LOST: the drone has lost its journal, and may have handed packages over."
        ),
    ]
    detail: Annotated[str, Field(description="The reason as a sentence.")]
    since_at: FleetMoment
