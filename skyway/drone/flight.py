"""How much power a flight takes, how long it takes, and how much energy it uses.

A landing (`stop_s`, `stop_j` of the model) is not in these numbers: a station may be flown over.
"""

from skyway.drone.model import DroneModel

#: Exponent of the total mass in the power of a hovering rotor, dimensionless (momentum theory:
#: the induced power of a rotor of fixed area is proportional to its thrust to the power 3/2).
MASS_EXPONENT = 1.5


def flight_power_w(model: DroneModel, load_kg: float) -> float:
    """Power in cruise with this load: `power_empty_w` times the mass ratio to the power 1.5."""
    mass_ratio = (model.empty_mass_kg + load_kg) / model.empty_mass_kg
    return model.power_empty_w * float(mass_ratio**MASS_EXPONENT)


def speed_mps(model: DroneModel, load_kg: float) -> float:
    """Cruising speed with this load, linear between the model's two speeds."""
    share_of_payload = load_kg / model.max_payload_kg
    return model.speed_empty_mps + (model.speed_full_mps - model.speed_empty_mps) * share_of_payload


def flight_time_s(model: DroneModel, *, length_m: float, load_kg: float) -> float:
    """Time to fly this length with this load."""
    return length_m / speed_mps(model, load_kg)


def flight_energy_j(model: DroneModel, *, length_m: float, load_kg: float) -> float:
    """Energy to fly this length with this load."""
    return flight_power_w(model, load_kg) * flight_time_s(model, length_m=length_m, load_kg=load_kg)


def soc_after_use(model: DroneModel, soc: float, *, energy_j: float) -> float:
    """State of charge after this energy is used; at least 0."""
    return max(0.0, soc - energy_j / model.battery_j)
