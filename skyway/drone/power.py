"""How much power a drone needs in flight."""

from skyway.drone.model import DroneModel

#: Exponent of the total mass in the power of a hovering rotor, dimensionless (momentum theory:
#: the induced power of a rotor of fixed area is proportional to its thrust to the power 3/2).
MASS_EXPONENT = 1.5


def flight_power_w(model: DroneModel, load_kg: float) -> float:
    """Power in cruise with this load: `power_empty_w` times the mass ratio to the power 1.5."""
    mass_ratio = (model.empty_mass_kg + load_kg) / model.empty_mass_kg
    return model.power_empty_w * float(mass_ratio**MASS_EXPONENT)
