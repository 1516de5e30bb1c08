"""Keeps the small world going on a running system."""

from collections.abc import Callable
from random import Random
from typing import Never

from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.drawn_request import RequestDraw
from skyway.cli.small_world.populate import populate
from skyway.cli.small_world.request_deliveries import MOST_OPEN, REQUEST_EVERY_S, Customers
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import read_secret
from skyway.network.bundled import texas_corridor


async def live_on(system: System, *, say: Callable[[str], None]) -> Never:
    """Register who is missing, start the drones, and request deliveries; this never returns.

    Raises
    ------
    SkywayError
        The gateway refuses a provider, a customer or the network.
    """
    network = texas_corridor()
    async with GatewayApi(system.urls["gateway"]) as api:
        known = await populate(system, api, network)
        say(
            f"The small world: {len(known.fleets)} providers with {len(known.drones)} drones, a "
            f"request every {REQUEST_EVERY_S:g} s while fewer than {MOST_OPEN} deliveries are open."
        )
        keys = (read_secret(system.folder, "customer_key"), *known.customer_keys.values())
        chance = Random()  # noqa: S311 - nothing is secret
        customers = Customers(api, keys, RequestDraw(network, chance), say=say)
        await customers.run()
