"""Corrects what a mission costs, by a new line in the present month."""

from typing import Final

from skyway.errors import InvalidInput
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.ledger.line import LedgerLine, month_of
from skyway_gateway.ledger.statement import Correction
from skyway_gateway.ledger.store import add_lines, lock_lines

#: The most that a mission costs, in minor units.
_MOST: Final = 10**12


async def correct(tx: Tx, requested: Correction, clock: FleetClock) -> LedgerLine:
    """Add a line for a mission that has lines; both parties see it with its note.

    Raises
    ------
    NotFound
        The ledger has no line of this mission: it is not settled yet, or does not exist.
    InvalidInput
        The amount is 0, or the mission would cost less than 0 or more than 10^12.
    """
    lines = await lock_lines(tx, requested.mission_id)
    if not lines:
        raise NotFound("settled mission", requested.mission_id)
    paid = sum(line.amount for line in lines)
    if requested.amount == 0 or not 0 <= paid + requested.amount <= _MOST:
        limits = f"must be between {-paid} and {_MOST - paid}, and not 0"
        raise InvalidInput("amount", f"{limits}: the mission costs {paid} now")
    at = ms_to_moment(moment_to_ms(clock.now()))
    change = {
        "number": lines[-1].number + 1,
        "kind": "CORRECTION",
        "amount": requested.amount,
        "note": requested.note,
        "at": at,
        "month": month_of(at),
    }
    line = lines[-1].model_copy(update=change)
    add_lines(tx, [line])
    return line
