"""Gives a proof: the drone that waits for it is instructed to hand the package over."""

from functools import partial

from skyway.contracts.instruction import HandOverInstruction
from skyway.contracts.mission import ProofAnswer
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import Conflict
from skyway_composition.context import Context
from skyway_composition.missions.mission.end import is_disbelieved
from skyway_composition.missions.mission.proof_store import Proof, last_proof, note_given
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, lock_mission


async def give_proof(
    context: Context, delivery_id: DeliveryId, package_id: PackageId
) -> ProofAnswer:
    """Note the proof and instruct the drone, in one transaction; a repeated call changes nothing.

    Raises
    ------
    Conflict
        NOT_AWAITED: no drone waits for this proof, or not any more. MISSION_OVER.
    """
    over = Conflict(
        "NOT_AWAITED", f"no drone waits for the proof of {package_id} of {delivery_id} now"
    )
    async with context.db.write() as tx:
        proof = await last_proof(tx.connection, delivery_id, package_id)
        if proof is None:
            raise over
        if proof.given_at is None:
            work, record = await lock_mission(context, tx, proof.mission_id, provider_id=None)
            # Another call may have given the proof before this one had locked the mission.
            proof = await last_proof(tx.connection, delivery_id, package_id) or proof
        if proof.given_at is None:
            if is_disbelieved(record) or not await _is_awaited(work, proof):
                raise over
            await note_given(tx, proof, at_ms=context.now_ms)
            draft = partial(
                HandOverInstruction,
                mission_id=proof.mission_id,
                mission_revision=record.mission.revision,
                step_id=proof.step_id,
                package_ids=(proof.flying_id,),
            )
            await work.send(record.drone_id, draft, expires_at=proof.until_at)
        return ProofAnswer(until_at=proof.until_at)


async def _is_awaited(work: MissionUnitOfWork, proof: Proof) -> bool:
    """Whether the drone still waits for this proof, as far as we know."""
    steps = await work.steps.of(proof.mission_id)
    planned = {each.step.step_id for each in steps if each.status == "PLANNED"}
    return work.clock.now() <= proof.until_at and proof.step_id in planned
