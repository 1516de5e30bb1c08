"""Evidence of a hand-over: where, when, and what the drone carried before and after."""

from datetime import datetime

from skyway.contracts.flight_step import DeliverStep, FlightStep, PickUpStep, ReturnStep
from skyway.contracts.message import utc_text
from skyway.ids import PackageId
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.step_places import end_of


def handed_over(step: FlightStep) -> tuple[PackageId, ...]:
    """The packages that change hands in this step."""
    if isinstance(step, PickUpStep):
        return tuple(package.package_id for package in step.packages)
    if isinstance(step, DeliverStep | ReturnStep):
        return step.package_ids
    return ()


def proof_of(step: FlightStep, logbook: Logbook, *, at: datetime) -> dict[str, object]:
    """Place, moment and weights of a hand-over, as an event's `data`."""
    if isinstance(step, PickUpStep):
        packages, sign = step.packages, 1
    else:
        handed = handed_over(step)
        packages, sign = tuple(one for one in logbook.packages if one.package_id in handed), -1
    mass_kg = {package.package_id: package.mass_kg for package in packages}
    return {
        "place": {"station_id": end_of(step), "position": list(logbook.position)},
        "at": utc_text(at),
        "mass_kg": mass_kg,
        "load_before_kg": logbook.load_kg,
        "load_after_kg": max(0.0, logbook.load_kg + sign * sum(mass_kg.values())),
    }
