"""Searches for a better schedule: estimates find a good order, the exact planner plans its trips.

Each round changes the best order so far by simulated annealing over the estimates of trips. The
first heat differs from round to round. Then the exact planner plans all trips of the new order
around each other's pads. The search keeps the new schedule if it costs less. After some rounds in
vain each round ends with random changes that the exact planner judges one by one. If the fleet is
small, each round also takes some steps of a branch and bound, and the search ends with its proof.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from skyway.dispatch.best_order import BestOrder
from skyway.dispatch.kept_promises import repaired
from skyway.dispatch.objective import Limits
from skyway.dispatch.order_moves import OrderMoves
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.rows import Board
from skyway.dispatch.schedule import Schedule, Scheduler
from skyway.planner.kernels.fleet_order import anneal
from skyway.planner.kernels.memory import Longs

#: Steps of the first round for each request, and the most steps of any round. Our own choice. The
#: first round of a small fleet is as short as the others.
_FIRST_STEPS: Final = 4_000
MOST_STEPS: Final = 400_000

#: Steps of each later round for each request.
_STEPS: Final = 800

#: The first heat of each round, as a share of the mean cost of a request: one value for the first
#: round, then these values in turn.
_FIRST_HEAT: Final = 0.5
_HEATS: Final = (0.2, 0.05, 0.5, 0.1, 0.02)

#: The last heat of each round, as a share of its first heat.
_COLD: Final = 0.01

#: After so many rounds in vain for each request, each round ends with changes that the exact
#: planner judges. With at most so many requests, these are moves. With more requests, annealing
#: finds better sequences in the same time, so these are leads, after so large a share of all rounds
#: in vain. If trips may be shared, annealing goes on to find better sequences, and there are none.
#: Our own choice.
_ROUNDS_IN_VAIN: Final = 0.25
_MOST_MOVED: Final = 20
_MOVES: Final = 40
_LEADS: Final = 12
_SHARE_IN_VAIN: Final = 0.5

#: Moves go on from a schedule that costs at most this share more than the best one. They begin at
#: the best one again after so many moves in vain. Our own choice.
_WORSE: Final = 0.005
_MOVES_IN_VAIN: Final = 60

#: Nodes of the branch and bound in each round. Our own choice: with more, the moves of fleets that
#: cannot be proven within the budget find less.
_NODES: Final = 100


@dataclass(slots=True)
class OrderSearch:
    """A search that can end after any round; `best` is the best schedule that keeps the limits.

    `tree` is the branch and bound of a small fleet.
    """

    scheduler: Scheduler
    board: Board
    limits: Limits
    arrival: Schedule
    best: Schedule
    chance: Longs
    moves: OrderMoves
    tree: BestOrder | None
    most_steps: int = MOST_STEPS
    rounds: int = 0
    #: Whether no order of the trips costs less than the best schedule.
    is_proven: bool = False
    #: How much sooner than by the rule of `Scheduler.planned` each request's trip is planned,
    #: ``(requests,)``, milliseconds.
    leads_ms: Longs = field(init=False)
    #: The schedule from which the moves go on.
    walked: Schedule = field(init=False)
    #: How many rounds, and how many moves, in a row found nothing better.
    rounds_in_vain: int = 0
    moves_in_vain: int = 0

    def __post_init__(self) -> None:
        self.walked = self.best
        self.leads_ms = np.zeros(len(self.scheduler.problem.requests), np.int64)

    def run(self, is_over: Callable[[int], bool]) -> None:
        """Search until `is_over` returns True for the number of rounds so far, or to the proof."""
        requests = len(self.scheduler.problem.requests)
        if requests == 0:
            return
        steps = (_FIRST_STEPS if self.tree is None else _STEPS) * requests
        heat = _FIRST_HEAT
        while not self.is_proven and not is_over(self.rounds):
            before_s = self.best.costs.total_s
            self._round(min(steps, self.most_steps), heat)
            is_better = self.best.costs.total_s < before_s
            self.rounds_in_vain = 0 if is_better else self.rounds_in_vain + 1
            self._change_exactly()
            self._prove(is_over)
            steps, heat = _STEPS * requests, _HEATS[self.rounds % len(_HEATS)]
            self.rounds += 1

    def _round(self, steps: int, heat: float) -> None:
        """Change the best order by annealing, and plan it exactly."""
        problem = self.scheduler.problem
        if self.leads_ms.any():
            self.board.vary(self.moves.draws)
        rows = self.board.rows(self.best.sequences(len(problem.drones)))
        mean_s = max(1.0, abs(rows.cost.sum()) / len(problem.requests))
        anneal(self.board.fleet, rows, self.chance, steps, heat * mean_s, heat * _COLD * mean_s)
        found = self.scheduler.planned(self.board.sequences(rows), leads_ms=self.leads_ms)
        if found.costs.total_s < self.best.costs.total_s:
            found = repaired(self.scheduler, found, self.limits.latest_s)
        self.look_at(found)
        self.board.harden(self._too_late(found))

    def _change_exactly(self) -> None:
        """Try changes that the exact planner judges, if annealing has found nothing for long."""
        requests = len(self.scheduler.problem.requests)
        if self.rounds_in_vain < _ROUNDS_IN_VAIN * requests:
            return
        if requests <= _MOST_MOVED:
            for _ in range(_MOVES):
                self._move()
        elif not self.board.has_shared and self.rounds_in_vain >= _SHARE_IN_VAIN * self.rounds:
            for _ in range(_LEADS):
                self._lead()

    def _prove(self, is_over: Callable[[int], bool]) -> None:
        """Take some steps of the branch and bound of a small fleet."""
        for _ in range(_NODES):
            if self.tree is None or self.tree.is_done or is_over(self.rounds):
                return
            self.best = self.tree.step(self.best)
            self.is_proven = self.tree.is_done and self.scheduler.planner.is_exact

    def _move(self) -> None:
        """Change the order of the walked schedule, and plan it exactly."""
        found = self.scheduler.in_order(self.moves.changed(self.walked.order), like=self.walked)
        before_s = self.best.costs.total_s
        self.look_at(found)
        is_better = self.best.costs.total_s < before_s
        self.moves_in_vain = 0 if is_better else self.moves_in_vain + 1
        allowed_s = self.best.costs.total_s + _WORSE * abs(self.best.costs.total_s)
        if self.moves_in_vain in (0, _MOVES_IN_VAIN):
            self.walked, self.moves_in_vain = self.best, 0
        elif found.costs.total_s <= allowed_s and self.limits.are_kept(found.costs):
            self.walked = found

    def _lead(self) -> None:
        """Plan the trips of the best schedule in another order; keep it if it costs no more."""
        leads_ms = self.moves.other_leads(self.leads_ms)
        sequences = self.best.sequences(len(self.scheduler.problem.drones))
        found = self.scheduler.planned(sequences, leads_ms=leads_ms, like=self.best)
        if found.costs.total_s <= self.best.costs.total_s and self.limits.are_kept(found.costs):
            self.best, self.leads_ms = found, leads_ms

    def _too_late(self, found: Schedule) -> Iterator[Pool]:
        """The shared trips that break promises."""
        latest_s = self.limits.latest_s
        for _, trip in found.trips:
            ends_s = (each / 1000 for each in trip.delivered_ms)
            if len(trip.pool) > 1 and any(
                end_s > latest_s.get(number, math.inf)
                for number, end_s in zip(trip.pool, ends_s, strict=True)
            ):
                yield trip.pool

    def look_at(self, found: Schedule | None) -> None:
        """Keep this schedule if it costs less and keeps the limits."""
        if found is None:
            return
        if found.costs.total_s < self.best.costs.total_s and self.limits.are_kept(found.costs):
            self.best = found
