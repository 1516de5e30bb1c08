"""The condition that holds in every query of what belongs to customers."""

from sqlalchemy import Column, ColumnElement, false, true

from skyway.runtime.http.identity import Caller


def owned(caller: Caller, customer_id: Column[str]) -> ColumnElement[bool]:
    """Whether what belongs to a customer is the caller's: operators see everybody's."""
    if caller.role == "operator":
        return true()
    return customer_id == caller.subject_id if caller.role == "customer" else false()
