"""The condition in every query of things that belong to customers."""

from sqlalchemy import Column, ColumnElement, false, true

from skyway.runtime.http.identity import Caller


def owned(caller: Caller, customer_id: Column[str]) -> ColumnElement[bool]:
    """Whether a row belongs to the caller; operators see all rows, providers none."""
    if caller.role == "operator":
        return true()
    return customer_id == caller.subject_id if caller.role == "customer" else false()
