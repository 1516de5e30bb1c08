"""A small busy world: real agents, a real composition, one pad a station, and a moved clock."""

import asyncio
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Any, Self

from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import Closure, ClosureKind
from skyway_composition.context import Context
from skyway_composition.links.listening import Listening
from skyway_composition.missions.booking.book import Bookings
from skyway_composition.missions.closure_impact.impact import GroundStopEnforcer, MissionImpact
from skyway_composition.missions.following.follow import ReportHandler
from skyway_composition.missions.interventions.cancel import cancel_packages
from skyway_composition.missions.interventions.confirm_loading import handle_confirmation
from skyway_composition.missions.interventions.give_command import Command, give_command
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.store import MissionFilter, page
from skyway_composition.missions.queue.dispatching.find_host import HostFinder
from skyway_composition.missions.queue.keep_calendars import Calendars
from skyway_composition.missions.replanning.foresee import Foresight
from skyway_composition.missions.replanning.go_sooner import WaitingMissions
from skyway_composition.missions.replanning.replan import Replanner
from skyway_composition.missions.timeouts import (
    LateMissions,
    LoadingTimeouts,
    OverdueMissions,
)
from skyway_composition.networks.measure_wind import MeasuredWinds
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.quarantine.set_aside import Quarantine
from skyway_composition.tables import metadata, missions, network_versions, outbox
from skyway_drone_agent.simulated.disturbances import UNDISTURBED
from skyway_verifier.composition.rules import RULES
from sqlalchemy import delete, select

from skyway.contracts.flight_step import PackageOnBoard
from skyway.contracts.mission import (
    OPEN_MISSION_STATES,
    BookMissions,
    Cancellation,
    CancelMissions,
    MissionState,
)
from skyway.contracts.mission_reports import MissionReport
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.ids import ClosureId, DeliveryId, MissionId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import Conflict
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from tests.broken_rules import broken_rules
from tests.composition.busy_network import MODEL, NETWORK_ID, PLACES, add_network
from tests.composition.drone_journals import ended_missions, handed_over, owners_of, shared_pads
from tests.composition.ended_world import check_ended
from tests.composition.flown_drone import FlownDrone
from tests.composition.lone_replica import lone_replica
from tests.composition.waiting_recipients import Recipients, give_proofs
from tests.counting_mint import CountingMint

#: Fleet seconds per second of wall time.
_RATE = 60.0

#: Composition checks all missions at least this often.
_LONGEST_STRIDE = timedelta(minutes=8)

#: While a story ends undisturbed and no mission waits to be sent, this often is enough.
_LAST_STRIDE = timedelta(minutes=30)

#: Instructions to a connected drone arrive within this time.
_DROPS_FOR = timedelta(minutes=1)

#: Silent turns of the event loop until the agents have nothing to do; 7 turns once preceded news.
_CALM_TURNS = 12

#: Every story ends within this time once all disturbances are over.
_OVER_WITHIN = timedelta(hours=30)

#: While the missions of a story end, the invariants are checked this often, and once afterwards.
_CHECKED_EVERY = timedelta(hours=4)

#: What composition repeats while time passes.
Sweep = (
    LateMissions
    | LoadingTimeouts
    | GroundStopEnforcer
    | OverdueMissions
    | MeasuredWinds
    | WaitingMissions
)


class BusyWorld:
    """Composition and its drones; time passes only when the test moves the clock."""

    #: How often drones in flight check for failures; a quarter of a second of wall time at `_RATE`.
    flight_stride = timedelta(seconds=15)
    database = Database

    def __init__(self, url: str, *, rate: float = _RATE) -> None:
        self.clock = ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC), rate=rate)
        self.mint = CountingMint()
        self.db = self.database(url, outbox=outbox)
        self.solver = SolverPool(threads=1, time_limit_s=5.0)
        self.drones: list[FlownDrone] = []
        self.handled: list[Received[Any]] = []
        self.requests: dict[str, DeliveryRequest] = {}
        self.attempts: dict[str, int] = {}
        self.released: set[tuple[str, str]] = set()
        self.loaders, self._bookings_under_way = "RIGHT", 0
        self.recipients: Recipients = "THERE"
        self._was_quiet: object = None
        self.restart()

    async def __aenter__(self) -> Self:
        await self.db.__aenter__()
        await self.solver.__aenter__()
        async with self.db.write() as tx:
            if (await tx.execute(select(network_versions.c.network_id))).first():
                # The database of an earlier story is used again.
                for table in reversed(metadata.sorted_tables):
                    await tx.execute(delete(table))
            await self.add_network(tx)
        for drone in self.make_drones():
            self.drones.append(drone)
            await drone.start()
        await self.converse()
        return self

    async def add_network(self, tx: Tx) -> None:
        await add_network(tx, now_ms=self.now_ms)

    def make_drones(self) -> Iterator[FlownDrone]:
        """The drones of this world, at home."""
        for number, home in enumerate("aabc", 1):
            yield FlownDrone(
                f"drn_{number}", model=MODEL, home=home, position=PLACES[home], clock=self.clock
            )

    async def __aexit__(self, *_: object) -> None:
        for drone in self.drones:
            await drone.stop()
        await self.solver.__aexit__(None, None, None)
        await self.db.__aexit__(None, None, None)

    def restart(self) -> None:
        """Restart composition as after kill -9: new objects on the same database."""
        db, clock, mint, networks = self.db, self.clock, self.mint, self.networks()
        self.context = context = Context(
            db=db, clock=clock, mint=mint, networks=networks, solver=self.solver
        )
        shared = HostFinder(context, tolerance_s=60.0)
        self.bookings = Bookings(context, pause=self._pause, shared=shared)
        impact = MissionImpact(context, Foresight(context))
        self.closings = Closings(db, networks, impact, clock, mint)
        listening = Listening(clock, lone_replica(db, clock))
        quarantine = Quarantine(db, clock=clock, mint=mint, listening=listening)
        self.handler = ReportHandler(context, quarantine)
        self.replanner = Replanner(context, "hot", self.closings)
        self.sweeps: tuple[Sweep, ...] = (
            LateMissions(context),
            LoadingTimeouts(context),
            GroundStopEnforcer(context, self.closings),
            OverdueMissions(context, listening),
            WaitingMissions(context),
        )
        self.calendars = Calendars(context, tolerance_s=60.0)

    def networks(self) -> PreparedNetworks:
        return PreparedNetworks(self.db, self.clock)

    @property
    def now_ms(self) -> int:
        return moment_to_ms(self.clock.now())

    # Time and messages

    async def pass_time(self, by: timedelta, *, stride: timedelta = _LONGEST_STRIDE) -> None:
        """Let time pass, from one event to the next, in steps of at most `stride`."""
        until = self.clock.now() + by
        looked_at = self.clock.now()
        while (now := self.clock.now()) < until:
            ahead = [each.next_end() for each in self.drones]
            ahead += [each.next_begin() for each in self.drones]
            moments = [each for each in ahead if each is not None and each > now]
            drops_instructions = any(each.drops_instructions for each in self.drones)
            may_fail = any(each.may_fail_any_time for each in self.drones)
            calm_stride = _DROPS_FOR if drops_instructions else stride
            soon = now + (self.flight_stride if may_fail else calm_stride)
            self.clock.advance(min([until, soon, *moments]) - now)
            if may_fail and await self._is_calm(since=looked_at):
                continue
            looked_at = self.clock.now()
            for drone in self.drones:
                drone.drops_instructions = False
            await self.converse()
            for sweep in self.sweeps:
                await sweep.step()
            await self._load()
            await give_proofs(self.context, self.recipients)
            await self.keep_calendars()

    async def keep_calendars(self) -> None:
        """Send, move or give up missions that wait in calendars, until nothing is left to do."""
        await self.converse()
        for _ in range(20):
            if not await self.calendars.step():
                break
        await self.converse()

    async def _is_calm(self, *, since: datetime) -> bool:
        """Whether no drone has a message to send, and no check of missions is due."""
        await self.settle()
        has_news = any(each.unsent and not each.is_held_back for each in self.drones)
        return not has_news and self.clock.now() - since < _LONGEST_STRIDE

    async def converse(self) -> None:
        """Exchange messages until neither drones nor composition have new ones."""
        await self.settle()
        if self._was_quiet == self._moment() and not any(each.unsent for each in self.drones):
            return
        delivered: set[int] = set()
        for _ in range(60):
            is_quiet = not await self._listen()
            while await self.replanner.step():
                pass
            is_quiet = not await self._instruct(delivered) and is_quiet
            if is_quiet:
                self._was_quiet = self._moment()
                return
            await self.settle()
        raise AssertionError("the exchange of messages does not end")

    def _moment(self) -> object:
        """What an exchange depends on besides unsent messages; unlike all others on PostgreSQL."""
        if self.db.dialect != "sqlite":
            return object()
        links = [(each.drops_instructions, each.has_reception) for each in self.drones]
        return self.clock.now(), self.db.commits, self.handler, links

    async def settle(self) -> None:
        """Let the agents run until they have nothing more to do now."""
        calm = 0
        unsent = [len(each.unsent) + len(each.journal.happened) for each in self.drones]
        while calm < _CALM_TURNS:
            await asyncio.sleep(0)
            now_unsent = [len(each.unsent) + len(each.journal.happened) for each in self.drones]
            calm, unsent = (calm + 1, unsent) if now_unsent == unsent else (0, now_unsent)
        for drone in self.drones:
            drone.raise_agent_error()

    async def _listen(self) -> bool:
        batch: list[Received[Any]] = []
        for drone in self.drones:
            if not drone.is_held_back:
                batch += drone.unsent
                drone.unsent = []
        if batch:
            self.handled = (self.handled + batch)[-50:]
            await self.handler.handle(batch)
        return bool(batch)

    async def receive(self, batch: list[Received[Any]]) -> None:
        await self.handler.handle(batch)
        await self.converse()

    async def _instruct(self, delivered: set[int]) -> bool:
        query = select(outbox).where(outbox.c.channel == "mqtt").order_by(outbox.c.id)
        async with self.db.read() as connection:
            rows = (await connection.execute(query)).all()
        new = [row for row in rows if row.id not in delivered]
        for row in new:
            delivered.add(row.id)
            for drone in self.drones:
                if drone.drone_id == row.stream and not drone.drops_instructions:
                    drone.receive_instruction(row.payload)
        return bool(new)

    # What people do

    def new_delivery(self) -> str:
        return self.mint("dlv").replace("_", "")

    async def book(
        self,
        delivery_id: str,
        request: DeliveryRequest,
        *,
        loading: str,
        drones: Sequence[FlownDrone] | None = None,
        ready_at: datetime | None = None,
    ) -> str:
        """Book one of these drones (None: of all) as the gateway does; returns the outcome."""
        self.requests.setdefault(delivery_id, request)
        attempt = self.attempts[delivery_id] = self.attempts.get(delivery_id, 0) + 1
        candidates = [
            each.candidate(loading=loading)
            for each in (self.drones if drones is None else drones)
            if each.logbook.mission is not None or each.logbook.station_id is not None
        ]
        shortlist = Shortlist.of(candidates)
        requested = BookMissions(
            attempt=attempt, request=request, shortlist=shortlist, ready_at=ready_at
        )
        self._bookings_under_way += 1
        try:
            return (await self.bookings.book(DeliveryId(delivery_id), requested)).outcome
        finally:
            self._bookings_under_way -= 1

    async def _pause(self, _wall_s: float) -> None:
        """Exchange messages while a booking waits for drones; among several, none is answered."""
        if self._bookings_under_way == 1:
            await self.converse()

    async def cancel(self, delivery_id: str, package_ids: tuple[str, ...] | None) -> Cancellation:
        wish = {"package_ids": package_ids, "reason": "changed my mind"}
        requested = CancelMissions.model_validate({"cancellation_id": self.mint("can"), **wish})
        answer = await cancel_packages(self.context, DeliveryId(delivery_id), requested)
        self.released |= {(delivery_id, each) for each in answer.released}
        await self.converse()
        return answer

    async def command(self, mission_id: MissionId, name: str, station_id: str | None) -> None:
        wish = {"command": name, "station_id": station_id, "reason": "an operator's wish"}
        with suppress(Conflict):
            await give_command(self.context, mission_id, Command.model_validate(wish))
        await self.converse()

    async def _load(self) -> None:
        """Loaders at the pickups confirm as `loaders` says."""
        for record in await self.live():
            if record.mission.loading != "AWAITED" or self.loaders == "NONE":
                continue
            factor = {"RIGHT": 1.0, "LITTLE_MORE": 1.03, "WRONG": 1.5}[self.loaders]
            listed = [
                PackageOnBoard(package_id=each.package_id, mass_kg=each.mass_kg * factor)
                for each in record.request.packages
            ]
            with suppress(Conflict):
                await handle_confirmation(self.context, record.mission_id, listed, provider_id=None)

    async def fetch_all(self) -> None:
        """Carry drones that landed in the open home, and repair them."""
        for drone in self.drones:
            if drone.logbook.is_down:
                home = drone.drone.home_station_id
                drone.disturbances = UNDISTURBED
                await drone.fetch(home, PLACES[home])
        await self.converse()

    async def close(self, kind: ClosureKind, **members: Any) -> Closure:
        now = self.now_ms
        closure = Closure(ClosureId(""), kind, NETWORK_ID, from_ms=now, made_ms=now, **members)
        made, _ = await self.closings.make(closure)
        await self.converse()
        return made

    async def reopen(self, closure: Closure) -> None:
        await self.closings.lift(closure)
        await self.converse()

    async def live(self) -> list[MissionRecord]:
        """The missions that were sent and are not over."""
        return [each for each in await self.planned() if each.is_live]

    async def planned(self) -> list[MissionRecord]:
        """The missions that are not over, in the order of their drones and starts."""
        async with self.db.read() as connection:
            records = await page(connection, MissionFilter(), before=None, limit=10_000)
        return sorted(
            (each for each in records if each.mission.state in OPEN_MISSION_STATES),
            key=lambda each: (each.drone_id, each.start.at_ms),
        )

    # What must hold

    async def handed_over(self) -> list[tuple[str, str]]:
        """Each hand-over in the drones' journals, as delivery and package."""
        async with self.db.read() as connection:
            records = await page(connection, MissionFilter(), before=None, limit=10_000)
        owners = owners_of(records)
        return [(str(of), str(each)) for of, each in handed_over(self.drones, owners=owners)]

    async def check(self) -> None:
        """Check that no invariant is broken, in the database or in the drones' journals."""
        assert await broken_rules(self.db, RULES, wall_at=self.clock.wall_now()) == []
        times = Counter(await self.handed_over())
        assert [each for each, count in times.items() if count > 1] == []
        assert [each for each in times if each in self.released] == []
        ids = await self._missions()
        assert list(shared_pads(self.drones, given_up=ids["ABORTED"] | ids["REFUSED"])) == []
        assert ids["COMPLETED"] - ended_missions(self.drones) == set()

    async def end(self) -> None:
        """End all disturbances and check that all missions end and leave nothing reserved."""
        for drone in self.drones:
            drone.is_held_back = drone.drops_instructions = drone.refuses_next = False
            drone.set_reception(True)
            if drone.disturbances != UNDISTURBED:
                drone.disturbances = UNDISTURBED
                await drone.restart(with_journal=True)
        self.loaders = "RIGHT"
        checked_at = self.clock.now()
        over_at = checked_at + _OVER_WITHIN
        while ((records := await self.planned()) or self._flying()) and self.clock.now() < over_at:
            for record in records:
                if record.mission.is_held and record.is_live:
                    await self.command(record.mission_id, "RESUME", None)
                doubt = record.mission.doubt
                if doubt is not None and doubt.code == "JOURNAL_LOST":
                    # The drone cannot know what it did; people have looked at it.
                    await self.command(record.mission_id, "GIVE_UP", None)
            await self.fetch_all()
            stride = _LAST_STRIDE if all(each.is_live for each in records) else _LONGEST_STRIDE
            await self.pass_time(_LAST_STRIDE, stride=stride)
            if self.clock.now() - checked_at >= _CHECKED_EVERY:
                await self.check()
                checked_at = self.clock.now()
        await self.check()
        assert [str(each.mission_id) for each in records] + self._flying() == []
        reports, handed = await self.reports(), set(await self.handed_over())
        await check_ended(self.db, reports, deliveries=self.requests, handed_over=handed)

    async def reports(self, channel: str = "gateway") -> list[MissionReport]:
        """All reports to a service, in order."""
        query = select(outbox).where(outbox.c.channel == channel).order_by(outbox.c.id)
        async with self.db.read() as connection:
            rows = (await connection.execute(query)).all()
        return [MissionReport.model_validate_json(row.payload) for row in rows]

    async def _missions(self) -> defaultdict[MissionState, set[str]]:
        by_state: defaultdict[MissionState, set[str]] = defaultdict(set)
        async with self.db.read() as connection:
            for row in await connection.execute(select(missions.c.mission_id, missions.c.state)):
                by_state[row.state].add(row.mission_id)
        return by_state

    def _flying(self) -> list[str]:
        return [each.drone_id for each in self.drones if each.logbook.mission is not None]
