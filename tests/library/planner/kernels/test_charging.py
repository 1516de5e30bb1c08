"""The charge curve as the kernels read it, beside the physics of `skyway.drone`."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from skyway.drone.charging import recharge_time_s, soc_after_recharge
from skyway.drone.model import ChargePoint, DroneModel

_CURVE = (ChargePoint(40, 0.05), ChargePoint(500, 0.6), ChargePoint(900, 0.8), ChargePoint(2e3, 1))


@pytest.fixture
def curved(model: DroneModel) -> DroneModel:
    # A new model: a copy would keep the cached columns of the old charge curve.
    return DroneModel.model_validate(
        {**model.model_dump(), "charge_curve": _CURVE, "reserve_soc": 0.05}
    )


@pytest.fixture
def task(curved: DroneModel) -> SimpleNamespace:
    return SimpleNamespace(
        curve_s=np.array([point.time_s for point in _CURVE]),
        curve_j=np.array([point.soc * curved.battery_j for point in _CURVE]),
        reserve_j=0.05 * curved.battery_j,
        rounding_j=1e-9 * curved.battery_j,
    )


@pytest.mark.parametrize("soc", [0.05, 0.1, 0.6, 0.61, 0.8, 0.95, 1.0])
def test_times_and_levels_equal_those_of_the_drone_model(
    plain: SimpleNamespace, task: SimpleNamespace, curved: DroneModel, soc: float
) -> None:
    charging, battery_j = plain.charging, curved.battery_j

    stay_s = charging.position_of(task, soc * battery_j) - charging.position_of(task, 0.05 * 1e5)

    assert stay_s == pytest.approx(recharge_time_s(curved, 0.05, soc))
    assert charging.level_at(task, 40 + stay_s) == pytest.approx(
        soc_after_recharge(curved, 0.05, stay_s) * battery_j
    )


def test_staying_and_raising_end_when_the_pad_cannot_give_more(
    plain: SimpleNamespace, task: SimpleNamespace
) -> None:
    charging = plain.charging
    charge = charging.Charge(500.0, 60_000.0, 700.0, 70_000.0)

    assert charging.after_staying(task, charge, 100.0)[:2] == pytest.approx((600.0, 65_000.0))
    assert charging.after_staying(task, charge, 300.0)[:2] == (700.0, 70_000.0)
    assert charging.until_left(task, charge, 100.0) == pytest.approx((500, 6e4, 600, 6.5e4))
    assert charging.after_raising(task, charge, 65_000.0)[:2] == pytest.approx((600.0, 65_000.0))
    assert charging.after_raising(task, charge, 50_000.0) == charge
    assert charging.after_raising(task, charge, 71_000.0).position == -1.0


def test_the_fewest_full_sessions_take_the_least_time(
    plain: SimpleNamespace, task: SimpleNamespace
) -> None:
    assert plain.charging.full_sessions_s(task, 0.0) == 0.0
    assert plain.charging.full_sessions_s(task, 95_000.0) == pytest.approx(1960.0)
    assert plain.charging.full_sessions_s(task, 95_000.0 + 20_000.0) == pytest.approx(3060.0)


def test_a_dominating_label_has_at_least_as_much_charge_at_every_moment(
    plain: SimpleNamespace, task: SimpleNamespace
) -> None:
    random = np.random.default_rng(3)
    rows = [_label(plain, task, random) for _ in range(60)]
    dominating = 0
    for one in rows:
        for other in rows:
            at_s = np.linspace(other[0], other[0] + other[3] - other[1], 25)
            leads = [
                _charge_j(plain, task, one, s) - _charge_j(plain, task, other, s) for s in at_s
            ]
            expected = one[0] <= other[0] and min(leads) >= -1e-6
            assert plain.dominance.dominates(task, one, other) == expected
            dominating += expected
    assert dominating > len(rows)


def _label(
    plain: SimpleNamespace, task: SimpleNamespace, random: np.random.Generator
) -> NDArray[np.float64]:
    first, last = np.sort(random.uniform(40, 2000, 2))
    levels = [plain.charging.level_at(task, position) for position in (first, last)]
    used_j = random.uniform(0, 40_000)
    time_s = random.uniform(0, 800)
    return np.array([time_s, first, levels[0], last, levels[1], used_j, np.inf, -np.inf])


def _charge_j(
    plain: SimpleNamespace, task: SimpleNamespace, row: NDArray[np.float64], at_s: float
) -> float:
    time_s, position, _, last, _, used_j = row[:6]
    if at_s < time_s:
        return -np.inf
    return float(plain.charging.level_at(task, min(position + at_s - time_s, last)) - used_j)
