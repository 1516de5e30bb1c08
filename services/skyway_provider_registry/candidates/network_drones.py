"""How many drones of each model a network has, and how many of them could fly now."""

import numpy as np

from skyway.contracts.drones import DronesOfModel, NetworkDrones
from skyway.ids import NetworkId
from skyway_provider_registry.candidates.fleet_view import NOWHERE, Fleet


def count_drones(fleet: Fleet, network_id: NetworkId, *, wall_now_ms: int) -> NetworkDrones:
    """The drones that stand in this network, or that are in the air and have their home there."""
    columns = fleet.columns
    network = columns.network_or_home()
    here = network == columns.network(network_id)
    is_online = here & (columns.column("online_until_ms") >= wall_now_ms)
    is_idle = is_online & ~columns.column("is_busy") & ~columns.column("is_low")
    # A drone that is free later counts as busy now.
    is_idle &= columns.column("free_ms") == 0
    of_model = columns.column("model")
    counts = [
        np.bincount(of_model[rows], minlength=len(columns.models))
        for rows in (here, is_online, is_idle)
    ]
    by_model = zip(columns.models.values(), *(each.tolist() for each in counts), strict=True)
    found = [
        DronesOfModel(
            model_id=model.model_id,
            max_payload_kg=model.max_payload_kg,
            model=model,
            registered=registered,
            online=online,
            idle=idle,
        )
        for model, registered, online, idle in by_model
        if registered
    ]
    return NetworkDrones(
        models=tuple(sorted(found, key=lambda each: each.model_id)),
        unplaced=int(np.count_nonzero(network == NOWHERE)),
    )
