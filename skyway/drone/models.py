"""Three named drone models: the maker's, the paper's as printed, and the paper's scenario."""

import math
from collections.abc import Mapping
from types import MappingProxyType

from skyway.drone.model import ChargePoint, DroneModel
from skyway.ids import DroneModelId
from skyway.units import hours_to_s, kmh_to_mps, minutes_to_s, wh_to_j

#: kg, with two TB60 batteries (DJI Matrice 300 RTK, specifications).
_EMPTY_MASS_KG = 6.3
#: kg, the maker's limit (DJI Matrice 300 RTK, specifications).
_DJI_PAYLOAD_KG = 2.7
#: kg, as the paper prints it (Shahzaad and Bouguettaya, evaluation).
_PAPER_PAYLOAD_KG = 15.3
#: J, two TB60 batteries of 274 Wh each (DJI Matrice 300 RTK, specifications).
_BATTERY_J = wh_to_j(2 * 274.0)
#: s, flight without payload until the battery is empty (maker and paper agree: 55 min).
_ENDURANCE_S = minutes_to_s(55.0)
#: m/s, 82.8 km/h, with and without payload (maker and paper agree).
_SPEED_MPS = kmh_to_mps(82.8)
#: W, 548 Wh in 55 min, rounded.
_DJI_POWER_EMPTY_W = 598.0
#: s, a full recharge (the paper, evaluation: 2.15 h).
_FULL_RECHARGE_S = hours_to_s(2.15)
#: s, from empty to the knee at constant current; 57 % of the whole, as lithium cells charge.
_RECHARGE_TO_KNEE_S = hours_to_s(1.23)
#: Charge at which constant voltage takes over (typical of lithium cells).
_KNEE_SOC = 0.8
#: Charges above the knee at which the curve has a point; the falling current never reaches 1.
_SOCS_ABOVE_KNEE = (0.84, 0.88, 0.91, 0.94, 0.96, 0.98, 0.99)
#: m, range of the empty drone in the paper's motivating scenario.
_SCENARIO_RANGE_M = 33_000.0


def _cc_cv_curve() -> tuple[ChargePoint, ...]:
    """Constant current to the knee, then t = tau ln((1 - s0) / (1 - s1)); 0.99 after 2.15 h."""
    tau_s = (_FULL_RECHARGE_S - _RECHARGE_TO_KNEE_S) / math.log(
        (1 - _KNEE_SOC) / (1 - _SOCS_ABOVE_KNEE[-1])
    )
    above_knee = (
        ChargePoint(_RECHARGE_TO_KNEE_S + tau_s * math.log((1 - _KNEE_SOC) / (1 - soc)), soc)
        for soc in _SOCS_ABOVE_KNEE
    )
    return (ChargePoint(0.0, 0.0), ChargePoint(_RECHARGE_TO_KNEE_S, _KNEE_SOC), *above_knee)


def _paper_model(model_id: str, *, range_m: float) -> DroneModel:
    """The paper's drone with a battery for this range without load; it charges linearly to 1."""
    power_empty_w = _BATTERY_J / _ENDURANCE_S
    return DroneModel(
        model_id=DroneModelId(model_id),
        empty_mass_kg=_EMPTY_MASS_KG,
        max_payload_kg=_PAPER_PAYLOAD_KG,
        battery_j=power_empty_w * range_m / _SPEED_MPS,
        reserve_soc=0.0,
        speed_empty_mps=_SPEED_MPS,
        speed_full_mps=_SPEED_MPS,
        power_empty_w=power_empty_w,
        charge_curve=(ChargePoint(0.0, 0.0), ChargePoint(_FULL_RECHARGE_S, 1.0)),
    )


#: The maker's sheet: 2.7 kg payload; a CC-CV charge curve; a tenth of the battery kept.
DJI_MATRICE_300_RTK = DroneModel(
    model_id=DroneModelId("dji-matrice-300-rtk"),
    empty_mass_kg=_EMPTY_MASS_KG,
    max_payload_kg=_DJI_PAYLOAD_KG,
    battery_j=_BATTERY_J,
    reserve_soc=0.1,
    speed_empty_mps=_SPEED_MPS,
    speed_full_mps=_SPEED_MPS,
    power_empty_w=_DJI_POWER_EMPTY_W,
    charge_curve=_cc_cv_curve(),
)

#: As the paper prints it: 15.3 kg, 75.9 km empty, 2.15 h linear, no reserve.
PAPER_MATRICE_300 = _paper_model("paper-matrice-300", range_m=_SPEED_MPS * _ENDURANCE_S)

#: The same with the battery of the motivating scenario: 33 km empty, about 5 km full.
PAPER_SCENARIO = _paper_model("paper-scenario", range_m=_SCENARIO_RANGE_M)

DRONE_MODELS: Mapping[DroneModelId, DroneModel] = MappingProxyType(
    {model.model_id: model for model in (DJI_MATRICE_300_RTK, PAPER_MATRICE_300, PAPER_SCENARIO)}
)
