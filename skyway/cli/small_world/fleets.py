"""The providers of the small world: their drones have names, and charge fast.

Both models are made up. With the charge curve of the bundled models most drones would stand on pads
most of the time. Their limit of wind lets a gust close segments to them.
"""

from typing import Any, Final

from skyway.drone.model import ChargePoint, DroneModel
from skyway.ids import DroneModelId

#: Empty to full, as batteries for short hops charge; our own choice.
_CHARGE_CURVE: Final = (ChargePoint(0.0, 0.0), ChargePoint(900.0, 0.8), ChargePoint(1800.0, 1.0))

#: Above this wind the drones do not fly, m/s: what makers of such drones state.
MAX_WIND_MPS: Final = 12.0


def _model(
    model_id: str, *, mass_kg: float, payload_kg: float, battery_j: float, power_w: float
) -> DroneModel:
    return DroneModel(
        model_id=DroneModelId(model_id),
        empty_mass_kg=mass_kg,
        max_payload_kg=payload_kg,
        battery_j=battery_j,
        reserve_soc=0.1,
        speed_empty_mps=23.0,
        speed_full_mps=20.0,
        power_empty_w=power_w,
        max_wind_mps=MAX_WIND_MPS,
        charge_curve=_CHARGE_CURVE,
    )


#: Flies 55 km without a load.
_COURIER: Final = _model(
    "courier-four", mass_kg=5.5, payload_kg=3.0, battery_j=1.44e6, power_w=600.0
)

#: Flies 60 km without a load.
_CARRIER: Final = _model(
    "carrier-six", mass_kg=8.0, payload_kg=5.0, battery_j=2.35e6, power_w=900.0
)

MODELS: Final = (_COURIER, _CARRIER)

#: As `skyway.cli.demo.fleets.PROVIDERS`, with the names of the drones and their model.
PROVIDERS: Final[tuple[dict[str, Any], ...]] = (
    {
        "name": "Hill Country Drones",
        "tariff": {"currency": "USD", "base": 450, "per_km": 22, "per_recharge_minute": 2},
        "model_id": _COURIER.model_id,
        "drones": {
            "Bluebonnet": "new-braunfels",
            "Pecan": "marion",
            "Mesquite": "garden-ridge",
            "Agave": "live-oak",
            "Juniper": "selma",
            "Cypress": "shavano-park",
            "Sage": "universal-city",
        },
    },
    {
        "name": "Alamo Air Delivery",
        "tariff": {"currency": "USD", "base": 390, "per_km": 26, "per_recharge_minute": 1},
        "model_id": _COURIER.model_id,
        "drones": {
            "Comet": "alamo-heights",
            "Orion": "san-antonio",
            "Vega": "leon-valley",
            "Lyra": "castle-hills",
            "Polaris": "kirby",
            "Nova": "terrell-hills",
            "Meteor": "converse",
        },
    },
    {
        "name": "Guadalupe Couriers",
        "tariff": {"currency": "USD", "base": 520, "per_km": 20, "per_recharge_minute": 2},
        "model_id": _CARRIER.model_id,
        "drones": {
            "Ripple": "new-braunfels",
            "Eddy": "windcrest",
            "Rapid": "hollywood-park",
            "Current": "cibolo",
        },
    },
)
