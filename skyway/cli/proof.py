"""What a plan's status and lower bound say, in words."""

from collections.abc import Mapping
from typing import Any


def proof_of(plan: Mapping[str, Any]) -> str:  # a plan as JSON
    """Whether the plan's time is proven to be the earliest, or how much earlier one could be."""
    delivered_s, bound_s = plan.get("delivery_time_s"), plan.get("lower_bound_s")
    if plan.get("status") == "optimal":
        return "proven optimal: no plan delivers earlier"
    if delivered_s is None or bound_s is None:
        return "not proven optimal"
    earlier_s = delivered_s - bound_s
    return f"not proven optimal: another plan could be up to {earlier_s:,.0f} s earlier"
