"""What closes before a late drone has passed it: in time it would have been clear of that."""

from collections.abc import Iterable
from typing import Protocol

from skyway.contracts.flight_step import FlyStep
from skyway.ids import StationId
from skyway.units import moment_to_ms
from skyway_composition.missions.outlook.prediction import PredictedStep
from skyway_composition.missions.outlook.whereabouts import Whereabouts
from skyway_composition.missions.record import Trouble


class Closed(Protocol):
    """What is closed, as the flights of a plan ask."""

    def closes_landing(self, station_id: StationId, at_ms: float) -> bool:
        """Whether nobody may land there at that moment."""
        ...

    def closes_segment(
        self, from_id: StationId, to_id: StationId, *, start_ms: float, end_ms: float
    ) -> bool:
        """Whether a segment may not be flown at some moment of that time."""
        ...


def closed_by_then(
    ahead: Iterable[PredictedStep], where: Whereabouts, closed: Closed
) -> Trouble | None:
    """The first flight that meets what is closed, though it would not at the planned time.

    What is flown through anyway, since nothing else was left, was planned so.
    """
    for predicted in ahead:
        step = predicted.step
        if not isinstance(step, FlyStep):
            continue
        planned = moment_to_ms(step.planned_start_at), moment_to_ms(step.planned_end_at)
        expected = predicted.start_ms, predicted.end_ms
        is_begun = where.is_doing(step)
        if _meets(step, expected, closed, is_begun=is_begun) and not _meets(
            step, planned, closed, is_begun=is_begun
        ):
            detail = f"the way to {step.to_id!r} is closed by the time at which the drone comes"
            return Trouble(code="LATE", detail=detail)
    return None


def _meets(step: FlyStep, span_ms: tuple[int, int], closed: Closed, *, is_begun: bool) -> bool:
    """Whether a flight is led through or to what is closed; what has begun can only land."""
    start_ms, end_ms = span_ms
    if step.lands and closed.closes_landing(step.to_id, end_ms):
        return True
    return not is_begun and closed.closes_segment(
        step.from_id, step.to_id, start_ms=start_ms, end_ms=end_ms
    )
