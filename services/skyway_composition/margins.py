"""How long things take between cloud and drones: every margin of time, with the reason for it.

A margin is the larger of a span of fleet time, which drones and people need, and a span of wall
time, which programs and networks need. All numbers are our own choice.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock, fleet_margin


@dataclass(frozen=True, slots=True)
class Margin:
    """A span of fleet seconds, and one of wall seconds; the larger counts."""

    fleet_s: float
    wall_s: float

    def span(self, clock: FleetClock, *, more_wall_s: float = 0.0) -> timedelta:
        """The margin in fleet time, with this much more wall time."""
        return fleet_margin(clock, fleet_s=self.fleet_s, wall_s=self.wall_s + more_wall_s)

    def ms(self, clock: FleetClock, *, more_wall_s: float = 0.0) -> int:
        """The margin in milliseconds of fleet time."""
        return round(self.span(clock, more_wall_s=more_wall_s) / timedelta(milliseconds=1))


# Instructions on their way to a drone.

#: Until an instruction has usually reached its drone. A drone that it reaches later refuses it.
REACHES: Final = Margin(5.0, 1.0)

#: The same where the drone must not have loaded or landed meanwhile, so it must be more certain.
REACHES_SURELY: Final = Margin(5.0, 2.0)

#: The same, with the time to find a new plan first.
PLANNED_AND_REACHES_SURELY: Final = Margin(5.0, 4.0)

#: A drone may begin an instruction so long after it was sent: a short loss of its link is no harm.
INSTRUCTION_LIFE: Final = Margin(60.0, 10.0)

#: The least time that a drone waits for a proof: on a fast clock, programs give it too.
PROOF_ARRIVES: Final = Margin(0.0, 20.0)

# The start of missions.

#: From now to the start of a mission that is booked now: planned, stored, sent and accepted.
BOOKED_TO_START: Final = Margin(60.0, 2.0)

#: From the end of a mission to the start of the drone's next: the end is reported, the next sent.
HAND_OVER: Final = Margin(30.0, 1.5)

#: An idle drone gets a mission so long before its start; until then it may fly another one first.
SENT_AHEAD: Final = Margin(600.0, 5.0)

#: The same for a mission that waits for other packages: until then they may join it.
SENT_AHEAD_WAITING: Final = Margin(120.0, 5.0)

#: Until a drone's waiting missions have new plans: each plan takes some seconds of wall time.
PLANS_QUEUE: Final = Margin(30.0, 2.5)

#: A waiting mission stays with a drone that is not ready so long after its planned start.
WAITS_FOR_DRONE: Final = Margin(600.0, 60.0)

#: An accepted offer is held so long: the gateway writes and books it, perhaps after a restart.
ACCEPTED_IS_BOOKED: Final = Margin(0.0, 30.0)

# Changes of what waits. Missions that begin sooner than this keep their place.

#: Until another order of a fleet is found, saved and sent; the search comes on top.
ANOTHER_ORDER: Final = Margin(120.0, 3.0)

#: Until a request has joined a waiting mission: one plan, without a search.
JOINS: Final = Margin(60.0, 2.0)

#: A drone that gives way leaves its pads for so much longer: the service begins after its answer.
GIVES_WAY_LONGER: Final = Margin(60.0, 3.0)

# Reports on their way from a drone.

#: Until the report of a step that has ended has arrived.
REPORT_ARRIVES: Final = Margin(30.0, 2.0)

#: Until an answer that the broker has received is handled here. After a longer pause the broker
#: drops the connection of this process, which then asks for events again.
ACK_ARRIVES: Final = Margin(0.0, 10.0)

#: After this without an answer a mission that was sent is in doubt.
ANSWER_IS_DOUBTED: Final = Margin(300.0, 30.0)

#: After this without a report, from its planned end on, a mission is in doubt.
SILENCE_IS_DOUBTED: Final = Margin(3_600.0, 120.0)

#: A drone's state that says nothing new is stored after this, so that a restart finds it.
STATE_IS_STORED: Final = Margin(0.0, 300.0)

#: How far a drone's clock may be behind ours.
CLOCK_ERROR: Final = Margin(10.0, 1.0)

#: A drone that has refused a plan for lack of energy gets another after this: the wind can change.
ENERGY_IS_LOOKED_AT: Final = Margin(60.0, 2.0)
