"""Corruptions of money: charges, lines of the ledger, and closed months."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_COMPLETED: Final = (
    " WHERE mission_id IN (SELECT mission_id FROM missions WHERE delivery_id = :completed)"
)
_CHARGED: Final = "a mission is charged as its price, its terms and its packages say"
_ITEMS: Final = "the lines of a mission are the items of its charge"
_SAME: Final = "the lines of a mission have no gap, and name the same parties"
_PARTIES: Final = "a line names the parties of its mission"
_CLOSED: Final = "a month is closed after its end"
_TOTALS: Final = "the totals of a closed month are the sums of its lines"

#: Closes the months of all lines when their last line was written: too early.
_CLOSE: Final = (
    "INSERT INTO closed_months SELECT month, max(at_ms) FROM ledger GROUP BY month;"
    "INSERT INTO closed_totals SELECT month, 'customer', customer_id, currency, sum(amount),"
    " count(*) FROM ledger GROUP BY month, customer_id, currency;"
    "INSERT INTO closed_totals SELECT month, 'provider', provider_id, currency, sum(amount),"
    " count(*) FROM ledger GROUP BY month, provider_id, currency;"
)

LEDGER_CORRUPTIONS: Final = (
    Corruption(
        "a delivered mission that is not charged",
        "a mission is charged once all its packages are settled",
        gateway="UPDATE missions SET charged_amount = NULL" + _COMPLETED,
    ),
    Corruption(
        "a charge one cent lower",
        _CHARGED,
        gateway="UPDATE missions SET charged_amount = charged_amount - 1" + _COMPLETED,
    ),
    Corruption(
        "a refund for a delivery in time, in both places",
        _CHARGED,
        gateway="UPDATE missions SET charged_amount = 0, body = json_set(body,"
        " '$.charged.amount', 0, '$.charged.line_items', json('[]'))" + _COMPLETED,
    ),
    Corruption("a line lost", _ITEMS, gateway="DELETE FROM ledger" + _COMPLETED),
    Corruption(
        "a line one cent higher",
        _ITEMS,
        gateway="UPDATE ledger SET amount = amount + 1" + _COMPLETED + " AND number = 1",
    ),
    Corruption(
        "a line of another kind",
        _ITEMS,
        gateway="UPDATE ledger SET kind = 'MASS'" + _COMPLETED + " AND number = 1",
    ),
    Corruption(
        "a line of another customer",
        _PARTIES,
        gateway="UPDATE ledger SET customer_id = 'mallory'" + _COMPLETED,
    ),
    Corruption(
        "a line with another number",
        _SAME,
        gateway="UPDATE ledger SET number = 9" + _COMPLETED + " AND number = 1",
    ),
    Corruption(
        "a note on a line that is no correction",
        _SAME,
        gateway="UPDATE ledger SET note = 'x'" + _COMPLETED,
    ),
    Corruption(
        "a line in another month",
        "a line counts in the month in which it was written",
        gateway="UPDATE ledger SET month = '2020-01'" + _COMPLETED,
    ),
    Corruption(
        "a month closed before its end",
        _CLOSED,
        gateway=_CLOSE,
    ),
    Corruption(
        "a line that was added after its month was closed",
        _TOTALS,
        gateway=_CLOSE + "UPDATE closed_totals SET amount = amount - 1, lines = lines - 1",
    ),
    Corruption(
        "a total one cent higher",
        _TOTALS,
        gateway=_CLOSE + "UPDATE closed_totals SET amount = amount + 1 WHERE role = 'customer'",
    ),
    Corruption(
        "a total of a party without lines",
        _TOTALS,
        gateway=_CLOSE
        + "UPDATE closed_totals SET party_id = 'no ' || party_id WHERE role = 'provider'",
    ),
)
