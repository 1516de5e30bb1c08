"""How a drone says it is: kept as its JSON, and read only when somebody looks."""

from skyway.contracts.drone_health import ActiveFailsafe, DroneHealth, Fault
from skyway.contracts.drone_report import DroneState
from skyway.json_model import WireModel


class Condition(WireModel):
    """What a `state` message says of the drone's health, and of what it does by itself."""

    health: DroneHealth | None = None
    faults: tuple[Fault, ...] = ()
    failsafe: ActiveFailsafe | None = None


#: Of a drone that has not told of itself.
NOT_TOLD = Condition()


def condition_text(state: DroneState) -> str | None:
    """The JSON of a `Condition`; None when there is nothing to say."""
    if state.health is None and not state.faults and state.failsafe is None:
        return None
    told = Condition.model_construct(
        health=state.health, faults=state.faults, failsafe=state.failsafe
    )
    return told.model_dump_json(exclude_defaults=True)


def condition_of(text: str | None) -> Condition:
    """What `condition_text` made a text of."""
    return NOT_TOLD if text is None else Condition.read(text)
