"""A fleet: calendars of drones in one network that are planned together, with what may move."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, takewhile

from skyway.contracts.candidate import Candidate
from skyway.delivery.offer import Tariff
from skyway.delivery.plan import Plan
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.network.network import Network
from skyway.scheduling.stays import Slot, Stay, slot_after
from skyway.units import CHARGE_TOLERANCE
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.networks.store import Present
from skyway_composition.planning.offer import distance_flown_m, price_of_plan
from skyway_composition.planning.world import World

#: The order of the QUEUED missions of some drones.
Orders = Mapping[DroneId, tuple[MissionId, ...]]


@dataclass(frozen=True, slots=True)
class Moments:
    """Moments and spans of fleet time in milliseconds.

    What begins before `settled_ms` does not move any more. `hand_over_ms` lies between two missions
    of a drone.
    """

    now_ms: int
    settled_ms: int
    hand_over_ms: int

    @property
    def last_kept_ms(self) -> int:
        """QUEUED missions that begin later may move."""
        return self.settled_ms + self.hand_over_ms


@dataclass(frozen=True, slots=True)
class Calendar:
    """A drone's missions that are not over, in order: sent, kept as they are, and waiting.

    `waiting` may move. `stays` are those of the last mission before them; an idle drone has none,
    and is `here`. `candidate` is the drone as one of its missions was booked, or as the registry
    knows it now. `version` is the number of the calendar.
    """

    candidate: Candidate
    live: MissionRecord | None
    kept: tuple[MissionRecord, ...]
    waiting: tuple[MissionRecord, ...]
    stays: tuple[Stay, ...]
    here: Slot | None
    version: int

    @property
    def drone_id(self) -> DroneId:
        """The drone."""
        return self.candidate.drone_id

    @property
    def queued(self) -> tuple[MissionRecord, ...]:
        """All QUEUED missions of the drone."""
        return (*self.kept, *self.waiting)

    @property
    def before(self) -> MissionRecord | None:
        """The mission before the waiting ones."""
        return self.kept[-1] if self.kept else self.live

    def slot(self, *, not_before_ms: int, times: Moments) -> Slot | None:
        """Where and when the first waiting mission can begin; None if that is not known."""
        not_before_ms = max(not_before_ms, times.settled_ms)
        if self.here is not None:
            return replace(self.here, at_ms=not_before_ms)
        return slot_after(self.stays, not_before_ms=not_before_ms, hand_over_ms=times.hand_over_ms)


@dataclass(frozen=True, slots=True)
class Fleet:
    """The calendars of drones whose waiting missions may be exchanged, by drone.

    With drones of several providers, `tariffs` are those of the providers that exchange deliveries.
    """

    calendars: Mapping[DroneId, Calendar]
    tariffs: Mapping[ProviderId, Tariff] = field(default_factory=dict)

    @property
    def waiting(self) -> tuple[MissionRecord, ...]:
        """All missions that may move, in the order in which they were booked."""
        found = [one for each in self.calendars.values() for one in each.waiting]
        return tuple(sorted(found, key=lambda each: each.mission_id))

    @property
    def orders(self) -> dict[DroneId, tuple[MissionId, ...]]:
        """The present order of the waiting missions of each drone."""
        return {
            drone_id: tuple(one.mission_id for one in each.waiting)
            for drone_id, each in self.calendars.items()
        }

    def is_planned_in(self, present: Present) -> bool:
        """Whether all waiting missions were planned for the present network and its closures."""
        return all(each.planned_in == present for each in self.waiting)

    def only(self, drone_ids: Collection[DroneId]) -> "Fleet":
        """The calendars of these drones."""
        kept = {key: each for key, each in self.calendars.items() if key in drone_ids}
        return replace(self, calendars=kept)

    def may_fly(
        self, record: MissionRecord, drone: Candidate, plan: Plan, *, network: Network
    ) -> bool:
        """Whether this drone may fly the mission by this plan.

        A drone of another provider may if the customer and both providers agree, if the mission
        flies for one delivery, if it is loaded in the same way, and if the other provider's tariff
        asks for at most the price that the customer has accepted.
        """
        own_id, other_id = record.mission.provider_id, drone.provider_id
        if own_id == other_id:
            return True
        qos, tariff = record.request.qos, self.tariffs.get(other_id)
        if tariff is None or own_id not in self.tariffs or not qos.may_change_provider:
            return False
        is_alike = not record.shares and drone.loading == record.candidate.loading
        if not is_alike or not qos.providers.admits(other_id):
            return False
        distance_m = distance_flown_m(network, plan)
        asked = price_of_plan(tariff, plan, record.request, distance_m=distance_m)
        agreed = record.mission.price
        return asked.currency == agreed.currency and asked.amount <= agreed.amount

    def providers_of(self, record: MissionRecord, *, network: Network) -> tuple[ProviderId, ...]:
        """The providers all of whose drones here may fly a mission as it is planned now."""
        drones = [each.candidate for each in self.calendars.values()]
        # Drones of one provider that are loaded alike may all fly it, or none of them.
        kinds = {(each.provider_id, each.loading): each for each in drones}
        plan = record.mission.plan
        may = {key: self.may_fly(record, kinds[key], plan, network=network) for key in kinds}
        refused = {provider_id for (provider_id, _), is_allowed in may.items() if not is_allowed}
        return tuple(sorted({provider_id for provider_id, _ in kinds} - refused))


def fleet_of(
    records: Iterable[MissionRecord],
    links: Mapping[DroneId, DroneLink],
    *,
    versions: Mapping[DroneId, int],
    left_out: Collection[DroneId],
    times: Moments,
) -> Fleet:
    """The fleet of these open missions, which are sorted by drone and start.

    `versions` are the numbers of the drones' calendars, read together with the missions.

    Left out are drones whose calendars cannot be planned now: a mission's plan is in question, or
    a drone without a sent mission is not ready to begin one.
    """
    found = {}
    for drone_id, own in groupby(records, key=lambda each: each.drone_id):
        if drone_id in left_out:
            continue
        link, version, missions = links.get(drone_id), versions[drone_id], [*own]
        calendar = calendar_of(
            missions[0].candidate, link, version=version, times=times, missions=missions
        )
        if calendar is not None:
            found[drone_id] = calendar
    return Fleet(found)


def calendar_of(
    candidate: Candidate,
    link: DroneLink | None,
    *,
    version: int,
    times: Moments,
    missions: Sequence[MissionRecord] = (),
) -> Calendar | None:
    """The calendar of a drone with these missions; None if it cannot be planned now."""
    live = next((each for each in missions if each.is_live), None)
    queued = [each for each in missions if not each.is_live]
    # Missions that begin too soon to move.
    kept = tuple(takewhile(lambda each: each.start.at_ms <= times.last_kept_ms, queued))
    waiting = tuple(queued[len(kept) :])
    before = kept[-1] if kept else live
    here = None
    if live is not None and (live.proposal is not None or not live.stays):
        return None
    if live is None:
        here = _standing(link, times)
        if here is None:
            return None
    if before is not None:
        here = None
    stays = () if before is None else before.stays
    calendar = Calendar(candidate, live, kept, waiting, stays, here, version)
    return None if calendar.slot(not_before_ms=0, times=times) is None else calendar


def free_to_take_off(fleet: Fleet, world: World, times: Moments) -> Fleet:
    """The drones that may take off where their next missions would begin in this network."""
    free = {
        drone_id
        for drone_id, each in fleet.calendars.items()
        if (slot := each.slot(not_before_ms=0, times=times)) is not None
        and slot.station_id in world.skyway.network.stations
        and slot.soc >= each.candidate.model.reserve_soc - CHARGE_TOLERANCE
        and world.conditions.ground_stop(
            each.candidate.model_copy(update={"station_id": slot.station_id}), at_ms=slot.at_ms
        )
        is None
    }
    return fleet.only(free)


def _standing(link: DroneLink | None, times: Moments) -> Slot | None:
    """Where an idle drone stands ready; None if it is not known to be idle at a station."""
    if link is None or link.state is None or link.state.station_id is None:
        return None
    if link.has_unread_events or link.is_occupied or link.is_gone:
        return None
    return Slot(link.state.station_id, times.settled_ms, link.state.soc)
