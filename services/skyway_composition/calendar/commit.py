"""Locks what a plan was made with, in one order for all, and says whether it is still the same.

Every transaction locks contended rows in this order: delivery, hold, network, drones, missions,
stations.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from skyway.ids import DroneId, ProviderId
from skyway.runtime.sql.database import Tx
from skyway_composition.links.link import AtStep, DroneLink
from skyway_composition.links.store import lock_or_add_links
from skyway_composition.networks.store import Present, share_current


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a network, and the number of each drone's calendar, when a plan was made.

    A calendar's number is raised whenever the plan of a mission of the drone changes, a mission
    comes or leaves, a customer's hold on the drone begins or ends, or the drone becomes occupied
    or free. A drone without a link has number 0. The numbers must be read before the missions, or
    together with them. `at_steps` has drones whose plan depends on the step that they fly.
    """

    present: Present
    calendars: Mapping[DroneId, int]
    at_steps: Mapping[DroneId, AtStep] = field(default_factory=dict)


class WorldChanged(Exception):
    """The world is not as it was planned with: plan again.

    `drones` have other calendars than before; none if the network has changed, or time has passed.
    """

    def __init__(self, drones: Collection[DroneId] = ()) -> None:
        super().__init__(*sorted(drones))
        self.drones = frozenset(drones)


async def lock_network(tx: Tx, present: Present) -> None:
    """Lock a network against publications and closures until the transaction ends (I11).

    Raises
    ------
    WorldChanged
        A version was published, or a closure made or lifted, since `present` was read.
    """
    if await share_current(tx, present.network_id) != present:
        raise WorldChanged


async def lock_as_seen(
    tx: Tx,
    seen: Snapshot,
    *,
    providers: Mapping[DroneId, ProviderId] | None = None,
    also: Collection[DroneId] = (),
) -> dict[DroneId, DroneLink]:
    """Lock the network and the drones of a snapshot until the transaction ends; the drones' links.

    A drone in `providers` gets a link if it has none. The drones of `also` are locked too, because
    the transaction changes them.

    Raises
    ------
    WorldChanged
        The network or a calendar has changed, or a drone has gone on to another step.
    """
    await lock_network(tx, seen.present)
    links = await lock_or_add_links(tx, providers or {}, {*seen.calendars, *also})
    moved = {
        drone_id
        for drone_id, number in seen.calendars.items()
        if number != (0 if drone_id not in links else links[drone_id].calendar_version)
    }
    moved |= {
        drone_id
        for drone_id, step in seen.at_steps.items()
        if drone_id not in links or links[drone_id].at_step != step
    }
    if moved:
        raise WorldChanged(moved)
    return links
