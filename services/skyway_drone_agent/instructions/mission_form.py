"""Whether the steps of a mission fit together; a drone refuses steps that do not."""

from collections.abc import Sequence
from itertools import pairwise

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.ids import PackageId
from skyway_drone_agent.journal.logbook import end_of, start_of


def fault_in(
    steps: Sequence[FlightStep], *, first_step: int, packages: tuple[PackageOnBoard, ...]
) -> str | None:
    """The first fault in these steps, given the packages on board; None without a fault."""
    if not steps or steps[0].step_id != first_step:
        return f"the steps do not begin with first_step {first_step}"
    for before, step in pairwise(steps):
        if step.step_id != before.step_id + 1:
            return f"step {before.step_id} is followed by step {step.step_id}"
        if start_of(step) != end_of(before):
            return (
                f"step {step.step_id} begins at {start_of(step)}, "
                f"step {before.step_id} ends at {end_of(before)}"
            )
        if _stays_in_the_air(before) and not isinstance(step, FlyStep):
            return f"step {step.step_id} needs a landing, step {before.step_id} flies over"
    if _stays_in_the_air(steps[-1]):
        return f"step {steps[-1].step_id} is the last and does not land"
    return _fault_in_windows(steps) or _fault_in_hand_overs(steps, packages)


def heaviest_load_kg(steps: Sequence[FlightStep], packages: tuple[PackageOnBoard, ...]) -> float:
    """The most that is on board at any time during these steps."""
    load = {package.package_id: package.mass_kg for package in packages}
    heaviest_kg = sum(load.values())
    for step in steps:
        if isinstance(step, PickUpStep):
            load |= {package.package_id: package.mass_kg for package in step.packages}
            heaviest_kg = max(heaviest_kg, sum(load.values()))
        elif isinstance(step, DeliverStep | ReturnStep):
            load = {key: mass for key, mass in load.items() if key not in step.package_ids}
    return heaviest_kg


def _stays_in_the_air(step: FlightStep) -> bool:
    return isinstance(step, FlyStep) and not step.lands


def _fault_in_windows(steps: Sequence[FlightStep]) -> str | None:
    for step in steps:
        if step.planned_end_at < step.planned_start_at:
            return f"step {step.step_id} ends before it starts"
        if isinstance(step, RechargeStep) and step.not_after_at < step.not_before_at:
            return f"the reservation of step {step.step_id} ends before it starts"
    return None


def _fault_in_hand_overs(
    steps: Sequence[FlightStep], packages: tuple[PackageOnBoard, ...]
) -> str | None:
    on_board: set[PackageId] = {package.package_id for package in packages}
    for step in steps:
        if isinstance(step, PickUpStep):
            taken = {package.package_id for package in step.packages}
            if taken & on_board:
                return f"step {step.step_id} takes on {sorted(taken & on_board)} a second time"
            on_board |= taken
        elif isinstance(step, DeliverStep | ReturnStep):
            missing = set(step.package_ids) - on_board
            if missing:
                return f"step {step.step_id} hands over {sorted(missing)}, not on board then"
            on_board -= set(step.package_ids)
    return None
