"""The dispatcher decides which drone flies which requests in which order, for early deliveries.

Start with `optimise`; `problem` defines the input, `plan` the result. `schedule` plans a given
order with the exact planner (`trips`), `search` looks for better orders, and `bound` proves a lower
bound on the cost of every plan.
"""

from skyway.dispatch.optimise import optimise
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.problem import FleetProblem, read_fleet_problem

__all__ = ["FleetPlan", "FleetProblem", "optimise", "read_fleet_problem"]
