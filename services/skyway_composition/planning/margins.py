"""What plans are made with on top of what flights should take: the network's energy margin."""

from functools import lru_cache

from skyway.drone.model import DroneModel


@lru_cache(maxsize=1_000)
def with_margin(model: DroneModel, energy_margin: float) -> DroneModel:
    """The model as it is planned with: every flight takes `energy_margin` more, as a share.

    Only problems hold such a model. Whoever compares a drone with its plan, or asks for another
    plan, needs the true one, else the margin is added twice.
    """
    power_w = model.power_empty_w * (1 + energy_margin)
    return model.model_copy(update={"power_empty_w": power_w})
