"""The flight that a diverted drone is on: whether it lands is for the steps after it to say."""

from skyway.contracts.flight_step import FlyStep
from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.record import Proposal
from skyway_composition.missions.steps.store import change_step, steps_of


async def join(tx: Tx, mission_id: MissionId, proposal: Proposal) -> None:
    """Keep of the last flight that stays valid what the drone makes of it.

    Before another flight it flies on over its end, before anything else it lands there.
    """
    lands = not isinstance(proposal.steps[0], FlyStep)
    for each in await steps_of(tx.connection, mission_id):
        step = each.step
        is_last_valid = step.step_id == proposal.first_step - 1 and each.status == "PLANNED"
        if is_last_valid and isinstance(step, FlyStep) and step.lands != lands:
            await change_step(tx, mission_id, step.model_copy(update={"lands": lands}))
