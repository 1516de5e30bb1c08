"""Hosting: one process serves one drone or a whole simulated fleet.

A drone that was down is placed by people before it is served again.
"""

import asyncio
import contextlib
import logging
import resource
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from functools import partial
from typing import Never

from skyway.ids import DroneId
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.loading import keep_what_is_loaded
from skyway.runtime.minting import mint
from skyway.runtime.mqtt.client import MqttClient, Will
from skyway.runtime.signing.key_pair import PrivateKey
from skyway.runtime.signing.seal import DroneSeal
from skyway_drone_agent.agent import DroneAgent, MakeLink
from skyway_drone_agent.clock_keeper import KeptClock
from skyway_drone_agent.enrolment.cloud import CloudAccess
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone, client_tls
from skyway_drone_agent.journal.journal import JournalFolder
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Placed
from skyway_drone_agent.landing_book.book import LandingBook, StationReader
from skyway_drone_agent.landing_book.station_cache import StationCacheFile
from skyway_drone_agent.mavlink.settings import MavlinkSettings
from skyway_drone_agent.simulated.disturbances import UNDISTURBED, Disturbances
from skyway_drone_agent.simulated.link_loss import LinkWithOutages, has_outages
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Vehicle

log = logging.getLogger(__name__)

#: Wall seconds before a failed agent starts again from the drone's journal.
_AGAIN_AFTER_S = 5.0

#: Wall seconds within which a large fleet has connected, as a rule.
_SETTLED_AFTER_S = 30.0

#: Open files for each drone (its connection and its lock), and for the process itself.
_FILES_PER_DRONE, _OTHER_FILES = 2, 64


async def host_fleet(
    drones: tuple[EnrolledDrone, ...],
    folder: JournalFolder,
    *,
    mqtt_url: str | None,
    accesses: tuple[CloudAccess, ...] = (),
    disturbances: Disturbances = UNDISTURBED,
    mavlink: MavlinkSettings | None = None,
    api_url: str = "",
) -> None:
    """Serve all drones until cancelled; a drone that fails does not disturb the others.

    Without `mqtt_url` each drone connects where its enrolment says. With `mavlink` there is one
    drone, and its autopilot flies it. With `accesses` the process reads stations that no mission
    names. Pictures of hand-overs go to the gateway at `api_url`, or where the accesses are.

    Raises
    ------
    InvalidSettings
        No broker is named for a drone, or there are several drones with `mavlink`.
    """
    brokers = {drone.drone_id: mqtt_url or _enrolled_broker(drone) for drone in drones}
    api_url = api_url or next((each.api_url for each in accesses), "")
    clock = KeptClock(folder.clock_file)
    async with _landing_book(folder, accesses) as book:
        serve = partial(_keep_flying, folder=folder, clock=clock, book=book, api_url=api_url)
        if mavlink is not None:
            await _host_real_drone(
                drones, folder, clock=clock, brokers=brokers, mavlink=mavlink, serve=serve
            )
        async with asyncio.TaskGroup() as group:
            group.create_task(_settle(), name="settle")
            for drone in drones:
                vehicle = SimulatedVehicle(
                    drone.model, clock, disturbances=disturbances, drone_id=drone.drone_id
                )
                make_link = _link_maker(
                    drone,
                    folder,
                    clock=clock,
                    mqtt_url=brokers[drone.drone_id],
                    disturbances=disturbances,
                )
                serving = serve(drone, vehicle=vehicle, make_link=make_link)
                group.create_task(serving, name=drone.drone_id)


@contextlib.asynccontextmanager
async def _landing_book(
    folder: JournalFolder, accesses: tuple[CloudAccess, ...]
) -> AsyncIterator[LandingBook]:
    """The landing book of this process. It reads stations while the block lasts."""
    book = LandingBook(StationReader(accesses), StationCacheFile(folder.landing_book_file))
    reading = asyncio.create_task(_keep_reading(book), name="landing book")
    try:
        yield book
    finally:
        reading.cancel()
        await asyncio.wait((reading,))


async def _host_real_drone(
    drones: tuple[EnrolledDrone, ...],
    folder: JournalFolder,
    *,
    clock: KeptClock,
    brokers: Mapping[DroneId, str],
    mavlink: MavlinkSettings,
    serve: Callable[..., Awaitable[Never]],
) -> Never:
    if len(drones) != 1:
        raise InvalidSettings(f"--vehicle is for one drone, and there are {len(drones)}")
    # Imported here, so that agents of simulated drones do not need pymavlink.
    from skyway_drone_agent.mavlink.link import mavlink_link
    from skyway_drone_agent.mavlink.vehicle import ready_vehicle

    (drone,) = drones
    make_link = _link_maker(
        drone,
        folder,
        clock=clock,
        mqtt_url=brokers[drone.drone_id],
        disturbances=UNDISTURBED,
    )
    async with mavlink_link(mavlink.address, clock, system_id=mavlink.system_id) as link:
        vehicle = await ready_vehicle(drone.model, clock, link, mavlink)
        await serve(drone, vehicle=vehicle, make_link=make_link)


def _enrolled_broker(drone: EnrolledDrone) -> str:
    """The addresses of the broker that the drone's enrolment names, separated by commas."""
    if not drone.mqtt_urls:
        raise InvalidSettings(
            "the broker is missing: --mqtt-url or SKYWAY_MQTT_URL"
            f" (the enrolment of drone {drone.drone_id} names none)"
        )
    return ",".join(drone.mqtt_urls)


def _link_maker(
    drone: EnrolledDrone,
    folder: JournalFolder,
    *,
    clock: KeptClock,
    mqtt_url: str,
    disturbances: Disturbances,
) -> MakeLink:
    """Makes the drone's links to the broker; a scenario may interrupt them."""
    shown = drone.certificate
    tls = None if shown is None else client_tls(shown, scratch=folder.path)
    own = None if drone.signing_key is None else PrivateKey.read(drone.signing_key)
    seal = DroneSeal(own, drone.cloud_keys)

    def make_link(
        will: Will, on_connected: Callable[[], Awaitable[None]]
    ) -> MqttClient | LinkWithOutages:
        client = MqttClient(
            mqtt_url,
            client_id=drone.user_name,
            user_name=drone.user_name,
            password=drone.mqtt.password,
            will=will,
            on_connected=on_connected,
            tls=tls,
            seal=seal,
        )
        if not has_outages(disturbances, drone.drone_id):
            return client
        return LinkWithOutages(client, clock, disturbed=disturbances, drone_id=drone.drone_id)

    return make_link


async def _settle() -> None:
    """Exclude the objects of the start from garbage collection.

    A thousand drones make 400,000 objects, and each collection of them would take 0.3 s.
    """
    await asyncio.sleep(_SETTLED_AFTER_S)
    keep_what_is_loaded()


async def _keep_reading(book: LandingBook) -> None:
    while True:
        try:
            return await book.run()
        except Exception:
            # The drones fly on with the stations that were read so far.
            log.exception("landing book failed")
            await asyncio.sleep(_AGAIN_AFTER_S)


async def _keep_flying(
    drone: EnrolledDrone,
    *,
    folder: JournalFolder,
    vehicle: Vehicle,
    clock: KeptClock,
    book: LandingBook,
    make_link: MakeLink,
    api_url: str,
) -> Never:
    while True:
        try:
            agent = DroneAgent(
                drone,
                journal=folder.journal_of(drone.drone_id),
                vehicle=vehicle,
                clock=clock,
                make_link=make_link,
                mint=mint,
                book=book,
                api_url=api_url,
            )
            await agent.run()
        except Exception:
            log.exception("drone agent failed", extra={"drone_id": drone.drone_id})
            await asyncio.sleep(_AGAIN_AFTER_S)


def allow_open_files(drones: int) -> None:
    """Raise this process's limit of open files for so many drones, as far as the system allows."""
    count = drones * _FILES_PER_DRONE + _OTHER_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < count:
        limit = count if hard == resource.RLIM_INFINITY else min(count, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


class NotDown(InvalidSettings):
    """The drone stands or flies, so its position cannot be set."""

    def __init__(self, drone_id: DroneId) -> None:
        super().__init__(f"{drone_id} is not down, so its position cannot be set")
        self.drone_id = drone_id


def place(drones: Sequence[EnrolledDrone], folder: JournalFolder, placed: Placed) -> None:
    """Write where the empty drone stands now; its mission is over."""
    if len(drones) != 1:
        raise InvalidSettings(f"--placed-at is for one drone, and there are {len(drones)}")
    (drone,) = drones
    journal = folder.journal_of(drone.drone_id)
    logbook = journal.read(at_first=drone.at_first())
    if not logbook.is_down:
        raise NotDown(drone.drone_id)
    # The whole file is rewritten: its last line may be torn, and must not get a line after it.
    journal.compact(logbook_after(logbook, placed))
