"""The values of a plan that a test expects to be there."""

from skyway.delivery.plan import Infeasibility, Plan


def delivery_time_s(plan: Plan) -> float:
    """The delivery time of a plan that has one."""
    assert plan.delivery_time_s is not None
    return plan.delivery_time_s


def lower_bound_s(plan: Plan) -> float:
    """The lower bound of a plan that has one."""
    assert plan.lower_bound_s is not None
    return plan.lower_bound_s


def infeasibility(plan: Plan) -> Infeasibility:
    """Why an infeasible plan is impossible."""
    assert plan.infeasibility is not None
    return plan.infeasibility
