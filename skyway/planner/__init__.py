"""The composition planner: which segments, in which order, recharging where and how much.

Start with `compose`; `problem` defines the input, `skyway.delivery.plan` the result. For many
problems on one network make its `Airspace` and its `Hierarchy` once. `compose_many` plans
thousands of `Trips` in one call.
"""

from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.compose_many import compose_many
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import PadBook
from skyway.planner.pad_ledger import PadLedger
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.planner.trip_terms import TripTerms
from skyway.planner.trips import Trips
from skyway.planner.verify import verify

__all__ = [
    "Airspace",
    "Hierarchy",
    "PadBook",
    "PadLedger",
    "Problem",
    "TripTerms",
    "Trips",
    "compose",
    "compose_many",
    "read_problem",
    "verify",
]
