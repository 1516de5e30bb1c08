"""What each account uses: its connections a second and its packets a second."""

import asyncio

from skyway.contracts.broker_rules import SERVICE_ACCOUNTS
from skyway.runtime.errors import BudgetSpent
from skyway.runtime.limits import Meter
from skyway_broker.limits import AccountLimits, Limits


class Usage:
    """Budgets of accounts; a client that connects again does not get a new budget."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._packets = {each: Meter(each.packets) for each in (limits.client, limits.service)}
        self._connects = {each: Meter(each.connects) for each in (limits.client, limits.service)}

    def limits_of(self, user_name: str) -> AccountLimits:
        """The limits of an account."""
        is_service = user_name in SERVICE_ACCOUNTS
        return self.limits.service if is_service else self.limits.client

    def may_connect(self, user_name: str) -> bool:
        """Whether the account may connect once more now; a connection that may is counted."""
        try:
            self._connects[self.limits_of(user_name)].spend(user_name)
        except BudgetSpent:
            return False
        return True

    async def pay(self, user_name: str, packets: float) -> None:
        """Return when the account's budget has room for so many packets, and take them.

        More than the whole budget counts as the whole budget.
        """
        limits = self.limits_of(user_name)
        packets = min(packets, limits.packets.burst)
        while True:
            try:
                self._packets[limits].spend(user_name, packets)
            except BudgetSpent as spent:
                await asyncio.sleep(spent.retry_after_s)
            else:
                return
