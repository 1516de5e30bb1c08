"""A fleet problem as other routing solvers can read it: trips of one request, and their needs.

A solver's clock counts the need of flights: their time plus the time to charge their energy. A
drone begins with its charge as credit. All drones are of one model.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Self

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.pools import SharedPools
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.rows import Board
from skyway.dispatch.schedule import Sequences
from skyway.planner.kernels.fleet_trips import NEED

#: No plan takes longer, seconds. Clocks start at this moment, so that credit is not negative.
HORIZON_S: Final = 1_000_000

#: How often a solver with hard ends runs, each time with another end. Our own choice.
RUNS: Final = 5


@dataclass(frozen=True, slots=True)
class RoutingTask:
    """Nodes are the requests, then the starts of the drones.

    Parameters
    ----------
    needs_s
        ``(nodes, requests)``: whole seconds from the end of a node to the end of a request.
    begins_s
        When the clock of each drone starts, whole seconds after `HORIZON_S`.
    """

    needs_s: list[list[int]]
    begins_s: list[int]
    problem: FleetProblem
    board: Board

    @classmethod
    def of(cls, problem: FleetProblem, estimates: Estimates) -> Self:
        """The task of this problem."""
        board = Board(
            problem,
            estimates,
            kinds=[0] * len(problem.drones),
            shared=SharedPools([], is_complete=True),
        )
        begins_s = [
            round(HORIZON_S + each.free_s - estimates.credit_s(0, each.soc))
            for each in problem.drones
        ]
        return cls(_needs(problem, estimates), begins_s, problem, board)

    @property
    def requests(self) -> int:
        """The number of requests."""
        return len(self.problem.requests)

    @property
    def drones(self) -> int:
        """The number of drones."""
        return len(self.problem.drones)

    def best_with_ends(self, order: Callable[[int], Sequences | None]) -> Sequences:
        """The order with the least estimated cost, for solvers that only keep a hard end.

        Such solvers make the whole way short, and know no mean delivery time. `order` receives the
        moment at which all trips are over, and returns None if the solver leaves a request out.
        The end is found by halving: first twice the mean need of a drone.
        """
        least_s = [min(row[one] for row in self.needs_s) for one in range(self.requests)]
        mean_s = (sum(least_s) + sum(self.begins_s) - HORIZON_S * self.drones) / self.drones
        low_s, high_s = max(0.0, mean_s), max(2.0 * mean_s, 1.5 * max(least_s))
        found: list[Sequences] = []
        for number in range(RUNS):
            end_s = high_s if number == 0 else (low_s + high_s) / 2
            one = order(HORIZON_S + round(end_s))
            if one is not None:
                found.append(one)
                high_s = end_s
            elif number == 0:
                low_s, high_s = high_s, 2 * high_s
            else:
                low_s = end_s
        if not found:
            return ((),) * self.drones
        return min(found, key=self.estimated_s)

    def estimated_s(self, sequences: Sequences) -> float:
        """The cost of these sequences by the estimates."""
        return float(self.board.rows(sequences).cost.sum())


def alone(numbers: Sequence[int]) -> tuple[tuple[int], ...]:
    """A trip for each of these requests, in order."""
    return tuple((each,) for each in numbers)


def _needs(problem: FleetProblem, estimates: Estimates) -> list[list[int]]:
    place_of, approach = estimates.place_of, estimates.approach(0)
    trips = [estimates.trip(0, (each,)) for each in range(len(problem.requests))]
    leaving = [each.best_end for each in trips]
    leaving += [place_of[each.station_id] for each in problem.drones]
    rows = []
    for row, place in enumerate(leaving):
        pause_s = problem.hand_over_s if row < len(trips) else 0.0
        rows.append(
            [
                round(pause_s + approach[place, place_of[request.source], NEED] + trip.best[NEED])
                for request, trip in zip(problem.requests, trips, strict=True)
            ]
        )
    return rows
