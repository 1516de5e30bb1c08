"""Stories of a busy world: actions of customers, drones, loaders and operators, in any order."""

import asyncio
import json
from collections.abc import Sequence
from datetime import timedelta
from random import Random
from typing import Any, Final

from hypothesis import note
from skyway_composition.closures.closure import Area, Closure
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.qos import QoS
from skyway.delivery.request import DeliveryRequest
from skyway.ids import StationId
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import dispatch_fairly
from tests.composition.dry_runs import preview
from tests.composition.flown_drone import FlownDrone
from tests.composition.left_packages import left_to_book

#: A zone without stations; the segment from a to b leads through it.
_ZONE: Final = [[0.04, -0.01], [0.06, -0.01], [0.06, 0.01], [0.04, 0.01], [0.04, -0.01]]
BETWEEN_A_AND_B: Final = Area.model_validate({"coordinates": [_ZONE]})

#: Each action; more frequent actions are listed more often.
ACTIONS: Final = (
    *["book"] * 6,
    *["book_together"] * 2,
    *["time_passes"] * 12,
    *["disturb_a_drone"] * 2,
    *["close"] * 2,
    *["reopen"] * 2,
    *["command"] * 2,
    *["cancel"] * 2,
    *["book_again"] * 1,
    "change_the_loaders",
    "lose_the_journal",
    "refuse_next",
    "lose_or_find_reception",
    "delay_messages",
    "drop_next_instructions",
    "lose_messages",
    "repeat_messages_in_disorder",
    "restart_composition",
    "change_the_recipients",
    *["break_down"] * 2,
    *["drift_off_course"] * 2,
    *["occupy_pads"] * 2,
    *["forget_a_hand_over"] * 2,
    *["fetch"] * 2,
    *["dispatch"] * 3,
)


def chosen_actions(chance: Random) -> list[tuple[str, int]]:
    """Actions of a story, each with its own chance: the same on every database."""
    return [(chance.choice(ACTIONS), chance.randrange(10_000)) for _ in range(25)]


class Story:
    """A world and the actions in it; `chance` chooses the details of an action."""

    def __init__(self, world: BusyWorld) -> None:
        self.world = world
        self.closures: list[Closure] = []

    @classmethod
    async def play(
        cls,
        url: str,
        actions: Sequence[tuple[str, int]],
        *,
        world_of: type[BusyWorld] = BusyWorld,
    ) -> list[str]:
        """Play a story from its first action to the end of all missions; returns all reports."""
        async with world_of(url) as world:
            story = cls(world)
            for name, seed in actions:
                note(f"{world.clock.now():%H:%M:%S} {name} {seed}")
                await getattr(story, name)(Random(seed))
                await world.check()
            note("end")
            for closure in story.closures:
                await world.reopen(closure)
            await world.end()
            return [_comparable(report) for report in await world.reports()]

    async def book_together(self, chance: Random) -> None:
        """Several customers book at the same time and see the same free drones and pads."""
        async with asyncio.TaskGroup() as customers:
            for _ in range(3):
                customers.create_task(self._order(chance))
        await self.world.keep_calendars()

    async def book(self, chance: Random) -> None:
        await self._order(chance)
        await self.world.keep_calendars()

    async def _order(self, chance: Random) -> None:
        delivery_id = self.world.new_delivery()
        pickup = chance.choice("aabc")
        others = [each for each in "abc" if each != pickup]
        mass_kg = chance.choice([0.4, 0.4, 3.0, 10.0])
        later = timedelta(hours=chance.choice([1, 3, 8])) if chance.random() < 0.25 else None
        request = DeliveryRequest.model_validate(
            {
                "pickup": {"station_id": pickup},
                "earliest_pickup_at": later and self.world.clock.now() + later,
                "packages": [
                    {
                        "package_id": f"{delivery_id}_{number}",
                        "mass_kg": mass_kg,
                        "destination": {"station_id": chance.choice(others)},
                        "alternative": {"station_id": chance.choice("abc")}
                        if chance.random() < 0.2
                        else None,
                        "dropoff_verification": {"method": chance.choice(["PIN", "PHOTO"])}
                        if chance.random() < 0.3
                        else None,
                    }
                    for number in range(chance.choice([1, 1, 2, 3]))
                ],
            }
        )
        loading = "CONFIRMED" if chance.random() < 0.3 else "AUTOMATIC"
        qos = QoS(may_be_later_s=chance.choice([0.0, 0.0, 3_600.0]))
        if chance.random() < 0.5:
            wait_s = chance.choice([0.0, 600.0, 1_800.0])
            shared = {"objective": "CHEAPEST", "pooling": True, "pooling_wait_s": wait_s}
            qos = qos.model_copy(update=shared)
        request = request.model_copy(update={"qos": qos})
        request = request.begun_after_wait(self.world.clock.now())
        note(f"  {await self.world.book(delivery_id, request, loading=loading)} {delivery_id}")

    async def book_again(self, chance: Random) -> None:
        """Book packages again that a drone has refused or that found no drone at first."""
        if not self.world.requests:
            return
        delivery_id = chance.choice(sorted(self.world.requests))
        request = await left_to_book(self.world, delivery_id)
        if request is not None:
            note(f"  {await self.world.book(delivery_id, request, loading='AUTOMATIC')}")
            await self.world.keep_calendars()

    async def cancel(self, chance: Random) -> None:
        if not self.world.requests:
            return
        delivery_id = chance.choice(sorted(self.world.requests)[-3:])
        ids = [each.package_id for each in self.world.requests[delivery_id].packages]
        chosen = None if chance.random() < 0.5 else (chance.choice(ids),)
        note(f"  {await self.world.cancel(delivery_id, chosen)}")

    async def time_passes(self, chance: Random) -> None:
        await self.world.pass_time(timedelta(minutes=chance.choice([1, 2, 4, 8, 8, 15, 30, 90])))

    async def dispatch(self, chance: Random) -> None:
        """The dispatcher moves what waits, and the customers gain by it."""
        await dispatch_fairly(self.world, tolerance_s=chance.choice([0.0, 60.0, 3_600.0]))
        await self.world.keep_calendars()

    async def disturb_a_drone(self, chance: Random) -> None:
        drone = chance.choice(self.world.drones)
        time, energy, charge = (chance.choice([0.8, 1.0, 1.0, 1.1, 1.25, 1.6]) for _ in range(3))
        absent = frozenset(StationId(each) for each in "abc" if chance.random() < 0.2)
        drone.disturbances = Disturbances(
            flight_time_factor=time,
            flight_energy_factor=energy,
            charge_time_factor=charge,
            absent_station_ids=absent,
        )
        await drone.restart(with_journal=True)
        await self.world.converse()

    async def break_down(self, chance: Random) -> None:
        """From now on a motor stops during each flight, until the drone is repaired."""
        after_s = chance.choice([60, 300, 600])
        await self._disturb(chance, motor={"share": 1.0, "after_s": after_s})

    async def drift_off_course(self, chance: Random) -> None:
        """The drone drifts off its course in each flight."""
        await self._disturb(chance, drift={"share": 1.0, "after_s": 60, "most_m": 600})

    async def _disturb(self, chance: Random, **how: Any) -> None:
        await self._disturb_these([chance.choice(self.world.drones)], **how)

    async def _disturb_these(self, drones: Sequence[FlownDrone], **how: Any) -> None:
        for drone in drones:
            note(f"  {drone.drone_id}")
            drone.disturbances = Disturbances.model_validate(how)
            await drone.restart(with_journal=True)
        await self.world.converse()

    async def occupy_pads(self, chance: Random) -> None:
        """Something occupies a station's pad for a while; arriving drones find it occupied."""
        now = self.world.clock.now()
        taken = {
            "station_id": chance.choice("abc"),
            "from_at": now,
            "until_at": now + timedelta(minutes=chance.choice([20, 60, 180])),
        }
        await self._disturb_these(self.world.drones, pads={"taken": [taken]})

    async def forget_a_hand_over(self, chance: Random) -> None:
        """A drone restarts during a hand-over and cannot know whether the hand-over was done."""
        for _ in range(15):
            busy = [each for each in self.world.drones if each.is_handing_over]
            if busy:
                drone = chance.choice(busy)
                note(f"  {drone.drone_id}")
                drone.is_forgetful = True
                await drone.restart(with_journal=True)
                drone.is_forgetful = False
                await self.world.converse()
                return
            await self.world.pass_time(timedelta(seconds=45))

    async def fetch(self, _: Random) -> None:
        await self.world.fetch_all()

    async def lose_the_journal(self, chance: Random) -> None:
        drone = chance.choice(self.world.drones)
        if drone.logbook.station_id is not None:
            await drone.restart(with_journal=False)
            await self.world.converse()

    async def refuse_next(self, chance: Random) -> None:
        chance.choice(self.world.drones).refuses_next = True

    async def lose_or_find_reception(self, chance: Random) -> None:
        away = [each for each in self.world.drones if not each.has_reception]
        drone = chance.choice(away or self.world.drones)
        drone.set_reception(not drone.has_reception)
        await self.world.converse()

    async def delay_messages(self, chance: Random) -> None:
        delayed = [each for each in self.world.drones if each.is_held_back]
        drone = chance.choice(delayed or self.world.drones)
        drone.is_held_back = not drone.is_held_back
        await self.world.converse()

    async def drop_next_instructions(self, chance: Random) -> None:
        chance.choice(self.world.drones).drops_instructions = True

    async def lose_messages(self, chance: Random) -> None:
        """Composition is away for a while, and all messages of this time are lost."""
        for drone in self.world.drones:
            drone.is_held_back = True
        await self.world.pass_time(timedelta(minutes=chance.choice([1, 5, 20])))
        for drone in self.world.drones:
            drone.is_held_back = False
            drone.unsent.clear()
        self.world.restart()
        await self.world.handler.ask_live_drones(lambda _drone_id: True)
        await self.world.converse()

    async def repeat_messages_in_disorder(self, chance: Random) -> None:
        batch = list(self.world.handled)
        for drone in self.world.drones:
            batch += drone.unsent
        chance.shuffle(batch)
        await self.world.receive(batch)

    async def close(self, chance: Random) -> None:
        station, other = chance.sample("abc", 2)
        members: dict[str, Any] = {}
        if chance.random() < 0.5:
            minutes = chance.choice([10, 40, 120])
            members["until_ms"] = self.world.now_ms + minutes * 60_000
        kind: Any = chance.choice(["STATION", "PAD", "SEGMENT", "ZONE", "GROUND_STOP"])
        match kind:
            case "STATION":
                members["station_id"] = station
            case "PAD":
                members |= {"station_id": station, "pad": 0}
            case "SEGMENT":
                members |= {"station_id": station, "to_station_id": other}
            case "ZONE":
                members["area"] = BETWEEN_A_AND_B
            case _:
                members["reason"] = "fog"
        note(f"  {kind} {station} {other}")
        self.closures.append(await self.world.close(kind, **members))

    async def reopen(self, chance: Random) -> None:
        if self.closures:
            chosen = self.closures.pop(chance.randrange(len(self.closures)))
            await self.world.reopen(chosen)

    async def command(self, chance: Random) -> None:
        records = await self.world.live()
        if not records:
            return
        record = chance.choice(records)
        names = ["HOLD", "DIVERT", "RETURN_HOME", "CANCEL"]
        name = "RESUME" if record.mission.is_held else chance.choice(names)
        station_id = chance.choice("abc") if name == "DIVERT" else None
        note(f"  {record.mission_id} {name} {station_id}")
        wish = {"command": name, "station_id": station_id, "reason": "an operator's question"}
        await preview(self.world, record.mission_id, wish)
        await self.world.command(record.mission_id, name, station_id)

    async def change_the_loaders(self, chance: Random) -> None:
        """From now on loaders load a little more, too much, nothing, or correctly again."""
        self.world.loaders = chance.choice(["RIGHT", "RIGHT", "LITTLE_MORE", "WRONG", "NONE"])

    async def change_the_recipients(self, chance: Random) -> None:
        """From now on recipients give all proofs, some, or none."""
        self.world.recipients = chance.choice(["THERE", "THERE", "FIRST", "ABSENT"])

    async def restart_composition(self, _: Random) -> None:
        self.world.restart()


def _comparable(report: MissionReport) -> str:
    """A report without the time that the planner took."""
    content = report.model_dump(mode="json")
    for plan in ("plan", "home_plan"):
        if content["mission"] is not None and content["mission"][plan] is not None:
            content["mission"][plan].pop("stats", None)
    return json.dumps(content)
