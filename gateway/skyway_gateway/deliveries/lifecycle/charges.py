"""What a customer pays for a mission, once nothing will happen to its packages any more.

The price is for the whole trip; each package carries the same part of it. `docs/money.md` has the
rules with examples.
"""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Final

from skyway.delivery.offer import Price, total_price
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.lifecycle.progress import CANCELLED_CODE, Progress, changed

#: Packages with these codes were not delivered because of their customer. The packages were
#: cancelled, not brought to the drone, or not what was announced; or nobody received them.
_BY_CUSTOMER: Final = frozenset(
    {
        CANCELLED_CODE,
        "LOADING_TIMEOUT",
        "PACKAGE_MISSING",
        "MASS_MISMATCH",
        "RECIPIENT_ABSENT",
    }
)


def with_charges(progress: Progress, *, host_delay: timedelta) -> Progress:
    """The delivery with the charge of each mission whose packages are all settled.

    A charge never changes later. `host_delay` is the lateness that does not count.
    """
    delivery = progress.delivery
    missions = tuple(_charged(each, delivery, host_delay) for each in delivery.missions)
    if missions == delivery.missions:
        return progress
    price = total_price([each.owed for each in missions])
    return Progress(changed(delivery, missions=missions, price=price), progress.happenings)


def _charged(mission: FlownMission, delivery: Delivery, host_delay: timedelta) -> FlownMission:
    packages = [each for each in delivery.packages if each.mission_id == mission.mission_id]
    is_open = not packages or not all(each.is_settled for each in packages)
    if mission.charged is not None or mission.state == "REFUSED" or is_open:
        return mission
    return mission.model_copy(update={"charged": charge_of(mission, packages, host_delay)})


def charge_of(
    mission: FlownMission, packages: Sequence[PackageStatus], host_delay: timedelta
) -> Price:
    """The price of a mission, less what is given back for its packages, which are all settled."""
    amount, terms = mission.price.amount, mission.payment_terms
    delivered = [each for each in packages if each.delivered_at is not None]
    by_customer = [each for each in packages if _is_by_customer(each)]
    failed = len(packages) - len(delivered) - len(by_customer)
    failure = amount * failed // len(packages)
    price = mission.price.plus("FAILURE", -failure)
    if delivered:
        shares = (terms.late_share(_later(each, host_delay)) for each in delivered)
        price = price.plus("LATENESS", -round(amount * sum(shares) / len(packages)))
        return price.plus("WAITING", _waiting_cost(mission, [*delivered, *by_customer]))
    has_flown = any(each.state != "CANCELLED" for each in by_customer)
    share = terms.cancellation.in_flight if has_flown else terms.cancellation.until_loaded
    price = price.plus("CANCELLATION", round((amount - failure) * share) - (amount - failure))
    return price.plus("WAITING", _waiting_cost(mission, by_customer))


def _waiting_cost(mission: FlownMission, packages: Sequence[PackageStatus]) -> int:
    """What the waits for proofs cost: each from the arrival to the last hand-over, or its end."""
    terms = mission.payment_terms.waiting
    if terms is None:
        return 0
    waits: dict[datetime, int] = {}
    for each in packages:
        if (wait := each.proof_wait) is not None:
            end_at = min(each.delivered_at or wait.until_at, wait.until_at)
            # The database has whole milliseconds.
            waited_ms = max(0, moment_to_ms(end_at) - moment_to_ms(wait.since_at))
            waits[wait.since_at] = max(waited_ms, waits.get(wait.since_at, 0))
    return sum(map(terms.cost_of, waits.values()))


def _is_by_customer(package: PackageStatus) -> bool:
    return package.delivered_at is None and package.code in _BY_CUSTOMER


def _later(package: PackageStatus, host_delay: timedelta) -> timedelta:
    """How much later than its promise a package was delivered; negative if it was earlier."""
    if package.delivered_at is None or package.due_at is None:
        return timedelta(0)
    return package.delivered_at - host_delay - package.due_at
