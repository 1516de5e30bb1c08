"""A mission at one moment: what was sent and how it went, who has what, what its drone says."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from skyway.contracts.drone_health import ActiveFailsafe
from skyway.contracts.flight_step import FlightStep, PickUpStep
from skyway.ids import PackageId
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.custody.chain import Held, on_board
from skyway_composition.missions.custody.store import held_packages
from skyway_composition.missions.escape import escape_of
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.steps.step_record import StepRecord
from skyway_composition.missions.steps.store import steps_of
from skyway_composition.missions.watch import Watch
from skyway_composition.networks.settings import NetworkSettings
from skyway_composition.planning.problem_for import planned_more


@dataclass(frozen=True, slots=True)
class Situation:
    """Read in one transaction; `held` is of this mission's packages alone."""

    record: MissionRecord
    link: DroneLink
    steps: tuple[StepRecord, ...]
    held: Mapping[PackageId, Held]

    @classmethod
    async def of(cls, watch: Watch, record: MissionRecord) -> Self:
        """The situation of a mission that is watched."""
        connection = watch.tx.connection
        held = await held_packages(connection, record.mission.delivery_id)
        steps = await steps_of(connection, record.mission_id)
        return cls(record, watch.links[record.drone_id], tuple(steps), record.own(held))

    @property
    def planned(self) -> tuple[FlightStep, ...]:
        """The steps that have not ended as far as is known, in order."""
        return tuple(each.step for each in self.steps if each.status == "PLANNED")

    @property
    def next_step(self) -> int:
        """The first step that has not ended as far as is known; one after the last if all have."""
        planned = self.planned
        return planned[0].step_id if planned else self.last_step + 1

    @property
    def last_step(self) -> int:
        """The last step of all."""
        return self.steps[-1].step.step_id if self.steps else 0

    @property
    def carried(self) -> frozenset[PackageId]:
        """What is on board as far as is known."""
        return on_board(self.held)

    @property
    def has_loaded(self) -> bool:
        """Whether the pickup is over, so that nothing is fetched there any more."""
        return any(
            isinstance(each.step, PickUpStep) and each.status == "ENDED" for each in self.steps
        )

    @property
    def escape(self) -> ActiveFailsafe | None:
        """The failsafe that leads the drone elsewhere now; None when it does as planned."""
        return escape_of(self.record, self.link.state)

    @property
    def consumption_factor(self) -> float:
        """What the drone uses against what its model says, as it last said; 1 before it has."""
        state = self.link.state
        return 1.0 if state is None or state.health is None else state.health.consumption_factor

    def energy_margin(self, settings: NetworkSettings) -> float:
        """What flights are planned to take more than the drone's model says, as a share."""
        return max(settings.energy_margin, planned_more(self.consumption_factor))

    @property
    def needs_pad_closed(self) -> bool:
        """Whether its drone found its pad taken, so that nobody should be sent there."""
        stuck = self.record.stuck
        return stuck is not None and stuck.occupied is not None

    @property
    def masses_kg(self) -> dict[PackageId, float]:
        """The mass of each package of the mission."""
        return {each.package_id: each.mass_kg for each in self.record.request.packages}
