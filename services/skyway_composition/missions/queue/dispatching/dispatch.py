"""Runs the dispatcher: it looks for better orders of what waits, and adopts them whole."""

import asyncio
import logging
from dataclasses import dataclass

from skyway.ids import NetworkId, ProviderId
from skyway.runtime.errors import RowRefused
from skyway.runtime.metrics import count, timed
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.context import Context
from skyway_composition.margins import REACHES
from skyway_composition.missions.queue.dispatching import store
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder, adopt
from skyway_composition.missions.queue.dispatching.find_order import OrderFinder

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Dispatcher:
    """Exchanges what waits between the drones of a provider, if the fleet then delivers earlier.

    After an adoption it wakes `calendars`.
    """

    context: Context
    finder: OrderFinder

    async def step(self) -> bool:
        """Step of a loop: look at each fleet once. Always False.

        With many fleets it rests between them, so that searches leave the processors to bookings.
        """
        for network_id, provider_id in await self.finder.fleets():
            await asyncio.sleep(self.finder.search.rest_s)
            await self.look_at(network_id, provider_id)
        return False

    async def look_at(self, network_id: NetworkId, provider_id: ProviderId) -> str:
        """Find a better order for one fleet and adopt it; returns the outcome."""
        with timed("skyway_dispatch_duration_seconds", "time of a look at one fleet"):
            found = await self.finder.find(network_id, provider_id)
            outcome = await self.adopt(found) if isinstance(found, BetterOrder) else found
        if outcome != "unsearched":
            count("skyway_dispatch_runs", "searches for a better order", outcome=outcome)
        return outcome

    async def adopt(self, better: BetterOrder) -> str:
        """Save a better order, if nothing has changed since; returns the outcome."""
        now = self.context.clock.now()
        if better.first_start_ms < moment_to_ms(now + REACHES.span(self.context.clock)):
            return "outdated"
        judgement = better.judgement
        try:
            async with self.context.db.write() as tx:
                await adopt(self.context, tx, better)
                await store.note_better_order(
                    tx,
                    better.provider_id,
                    moves=judgement.moves,
                    saved_s=judgement.saved_s,
                    at_ms=moment_to_ms(now),
                )
        except RowRefused as taken:
            log.info("a pad of a better order was taken", extra={"by": taken.constraint})
            return "taken"
        except WorldChanged:
            return "outdated"
        self.context.calendars.set()
        about = "seconds by which adopted orders deliver earlier"
        count("skyway_dispatch_saved_seconds", about, max(0.0, judgement.saved_s))
        guests = sum(len(each.guests) for each in better.merges)
        if guests:
            about = "deliveries that joined the mission of another one"
            count("skyway_shared_trips", about, guests)
        log.info(
            "better order adopted",
            extra={
                "missions": len(better.fleet.waiting),
                "moves": judgement.moves,
                "guests": guests,
                "saved_s": round(judgement.saved_s),
                "saved_j": round(judgement.saved_j),
            },
        )
        return "adopted"
