"""What it still takes to be down at the end of the released flights."""

from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.analysis.reach import Reach
from skyway_drone_agent.vehicles.reading import Reading


class EnergyToLand:
    """Judges anew while the drone is on its way; a landing uses up what was judged last."""

    __slots__ = ("_judged",)

    def __init__(self) -> None:
        self._judged: tuple[Leg, float, float] | None = None

    def need_j(
        self, reading: Reading, leg: Leg | None, flights: tuple[Leg, ...], *, reach: Reach
    ) -> float:
        """Energy for the leg under way, if any, and the flights after it."""
        if leg is None:
            return reach.need_j(flights)
        judged = self._judged
        if judged is not None and judged[0] is leg and not leg.is_on_the_way(reading):
            used_j = (reading.consumed_j - judged[2]) / reach.state_of_health
            return max(0.0, judged[1] - used_j)
        need_j = reach.need_j(flights, share_left=leg.share_left(reading.position))
        self._judged = (leg, need_j, reading.consumed_j)
        return need_j
