"""Finds the idle drones that could fly what waits, as a booking would find them now."""

from dataclasses import replace

from skyway.contracts.candidate import MOST_QUERIES, CandidateQuery
from skyway.delivery.qos import ProviderChoice
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway_composition.context import Context
from skyway_composition.links.store import held_among, links_to
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.ask_registry import shortlists_for
from skyway_composition.missions.queue.dispatching.fleet import Fleet, Moments, calendar_of
from skyway_composition.planning.world import World


async def idle_drones(
    context: Context, registry: ServiceClient, fleet: Fleet, world: World, times: Moments
) -> Fleet:
    """The drones without missions that could be first at the pickups of this fleet's missions.

    Of each provider at most `MAX_CANDIDATES_PER_PROVIDER` for one pickup. No drones if the registry
    does not answer.
    """
    try:
        found = await shortlists_for(registry, _queries(fleet, world, times))
    except (ServiceUnavailable, RemoteProblem):
        return fleet.only(())
    providers = {each.mission.provider_id for each in fleet.waiting} | fleet.tariffs.keys()
    temperature_c = world.conditions.temperature_c(times.settled_ms)
    candidates = {
        candidate.drone_id: candidate
        for shortlist in found
        for candidate in shortlist.in_cold(temperature_c).candidates
        if candidate.provider_id in providers and candidate.drone_id not in fleet.calendars
    }
    async with context.db.read() as connection:
        # The links first: they have the numbers of the calendars.
        links = await links_to(connection, candidates)
        engaged = {*(await store.open_missions_on(connection, candidates)).versions}
        engaged |= await held_among(connection, candidates, now_ms=times.now_ms)
    idle = (
        calendar_of(candidates[each.drone_id], each, version=each.calendar_version, times=times)
        for each in links.values()
        if each.drone_id not in engaged
    )
    return replace(fleet, calendars={each.drone_id: each for each in idle if each is not None})


def _queries(fleet: Fleet, world: World, times: Moments) -> tuple[CandidateQuery, ...]:
    """The questions about the missions that wait longest after the moment when they may begin."""
    stations = world.skyway.network.stations
    longest_first = sorted(
        fleet.waiting,
        key=lambda each: max(each.earliest_ms, times.settled_ms) - each.start.at_ms,
    )
    queries = (
        CandidateQuery.of(
            each.request,
            stations[each.request.pickup.station_id].position,
            providers=each.request.qos.providers
            if fleet.tariffs and each.request.qos.may_change_provider
            else ProviderChoice(pinned=each.mission.provider_id),
        )
        for each in longest_first
    )
    return tuple(dict.fromkeys(queries))[:MOST_QUERIES]
