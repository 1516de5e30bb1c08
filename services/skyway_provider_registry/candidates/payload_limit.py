"""The heaviest payload that anybody admitted could lift, whoever is free now."""

from collections.abc import Iterable

from skyway.contracts.candidate import PayloadLimit
from skyway.drone.model import DroneModel
from skyway.ids import ProviderId


def payload_limit(
    models: Iterable[DroneModel], *, unknown_provider_ids: tuple[ProviderId, ...]
) -> PayloadLimit:
    """The limit of the strongest of these models; equals by id."""
    strongest = min(models, key=lambda one: (-one.max_payload_kg, one.model_id), default=None)
    return PayloadLimit(
        max_payload_kg=strongest.max_payload_kg if strongest else None,
        drone_model_id=strongest.model_id if strongest else None,
        unknown_provider_ids=unknown_provider_ids,
    )
