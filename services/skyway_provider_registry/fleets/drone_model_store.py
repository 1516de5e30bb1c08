"""All drone models: the library's named models and the models of the table."""

from collections.abc import Mapping

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import drone_models, drones

Models = Mapping[DroneModelId, DroneModel]


async def every(connection: AsyncConnection) -> Models:
    """All models, sorted by id."""
    found = await connection.execute(select(drone_models.c.model))
    added = [DroneModel.read(text) for text in found.scalars()]
    models = {**{model.model_id: model for model in added}, **DRONE_MODELS}
    return dict(sorted(models.items()))


async def put(tx: Tx, model: DroneModel) -> bool:
    """Store a model under its id; True when the id is new.

    Raises
    ------
    Conflict
        The id belongs to another model of the library, or to a model of registered drones. The
        abilities of these drones must not change while plans use them.
    """
    previous = (await every(tx.connection)).get(model.model_id)
    if previous == model:
        return False
    if model.model_id in DRONE_MODELS:
        raise Conflict("NAMED_MODEL", f"{model.model_id} is one of Skyway's own drone models")
    if previous is not None and await _has_drones(tx, model.model_id):
        raise Conflict(
            "MODEL_IN_USE", f"drones of model {model.model_id} are registered: choose another id"
        )
    row = {"model_id": model.model_id, "model": model.model_dump_json()}
    statement = tx.insert(drone_models).values(row)
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["model_id"], set_={"model": statement.excluded.model}
        )
    )
    return previous is None


async def _has_drones(tx: Tx, model_id: DroneModelId) -> bool:
    statement = select(drones.c.drone_id).where(drones.c.model_id == model_id).limit(1)
    row: AnyRow | None = (await tx.execute(statement)).one_or_none()
    return row is not None
