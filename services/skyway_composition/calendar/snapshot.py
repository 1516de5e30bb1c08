"""What a plan was made with: the state of a network, and the calendars of some drones."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from skyway.ids import DroneId
from skyway_composition.links.link import AtStep
from skyway_composition.networks.store import Present


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
