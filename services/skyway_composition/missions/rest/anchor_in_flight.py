"""The anchor of a drone in flight: where it lands, or where it can turn before that."""

from collections.abc import Sequence
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.drone.model import DroneModel
from skyway_composition.missions.outlook.prediction import PredictedStep
from skyway_composition.missions.outlook.whereabouts import Whereabouts
from skyway_composition.missions.record import CALLED_HOME, Trouble
from skyway_composition.missions.rest.anchor import Anchor
from skyway_composition.missions.rest.closed_ahead import ClosedAhead

#: Troubles for which a drone turns at the end of the flight that it is on.
_TURNS_AT_ONCE: Final = (CALLED_HOME,)


def anchor_in_flight(
    ahead: Sequence[PredictedStep],
    where: Whereabouts,
    trouble: Trouble,
    *,
    model: DroneModel,
    closed: ClosedAhead,
) -> Anchor | None:
    """After the landing, or before what is closed on the way there; the flight itself goes on."""
    flights = [each for each in ahead if each.step.step_id <= where.released_through]
    last = flights[-1]
    must_turn = (
        trouble.land_at is not None
        or trouble.code in _TURNS_AT_ONCE
        or last.soc_end < model.reserve_soc
    )
    valid = flights[:1] if must_turn else _still_valid(flights, closed)
    end = valid[-1]
    if not isinstance(end.step, FlyStep):
        return None
    is_closed = closed.closes_landing(end.step.to_id, end.end_ms)
    # A plan that begins with a landing there pays for it, one that flies on is a little early.
    landing_soc = 0.0 if end.step.lands else model.stop_j / model.battery_j
    landing_ms = 0 if end.step.lands else round(model.stop_s * 1000)
    return Anchor(
        station_id=end.step.to_id,
        at_ms=end.end_ms + landing_ms,
        soc=max(0.0, end.soc_end - landing_soc),
        last_valid_step=end.step.step_id,
        carried=end.load.carried,
        has_loaded=True,
        is_divert=is_closed or end.step.step_id < where.released_through,
        is_in_the_air=is_closed,
    )


def _still_valid(flights: Sequence[PredictedStep], closed: ClosedAhead) -> Sequence[PredictedStep]:
    """The flights before the first one that leads through or to what is closed; at least one."""
    for number, flight in enumerate(flights):
        step = flight.step
        if not isinstance(step, FlyStep):
            continue
        # Only what has not begun can be left out, and a landing can become flying over.
        is_hit = number > 0 and closed.closes_segment(
            step.from_id, step.to_id, start_ms=flight.start_ms, end_ms=flight.end_ms
        )
        if is_hit or (step.lands and closed.closes_landing(step.to_id, flight.end_ms)):
            return flights[: max(1, number)]
    return flights
