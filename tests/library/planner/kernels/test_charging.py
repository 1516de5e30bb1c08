"""The charge curve as the kernels read it, beside the physics of `skyway.drone`."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from skyway.drone.charging import model_on_pad, recharge_time_s, soc_after_recharge
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
        curve_at=np.zeros(0, np.int32),
        curve_offsets=np.array([0, len(_CURVE)]),
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

    stay_s = charging.position_of(task, 0, soc * battery_j) - charging.position_of(
        task, 0, 0.05 * 1e5
    )

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


@pytest.fixture
def task_of_two_curves(task: SimpleNamespace, curved: DroneModel) -> SimpleNamespace:
    """The second curve is that of pads with 50 W; it is slower up to 60 % of the battery."""
    times_s, _ = model_on_pad(curved, 50.0).charge_columns
    return SimpleNamespace(
        **vars(task)
        | {
            "curve_at": np.array([0, 1], np.int32),
            "curve_offsets": np.array([0, 4, 8]),
            "curve_s": np.array([*task.curve_s, *(2_001.0 + np.array(times_s))]),
            "curve_j": np.tile(task.curve_j, 2),
        }
    )


def test_a_position_belongs_to_one_curve_and_keeps_to_it(
    plain: SimpleNamespace, task_of_two_curves: SimpleNamespace, curved: DroneModel
) -> None:
    charging, task = plain.charging, task_of_two_curves
    slow, battery_j = model_on_pad(curved, 50.0), curved.battery_j
    begun, top = (charging.position_of(task, 1, share * battery_j) for share in (0.1, 1.0))
    charge = charging.Charge(begun, 0.1 * battery_j, top, battery_j)

    raised = charging.after_raising(task, charge, 0.7 * battery_j)

    assert raised.position - begun == pytest.approx(recharge_time_s(slow, 0.1, 0.7))
    assert charging.after_staying(task, charge, 300.0).level == pytest.approx(
        soc_after_recharge(slow, 0.1, 300.0) * battery_j
    )


def test_it_is_worth_staying_on_a_fast_pad_until_the_drone_itself_sets_the_pace(
    plain: SimpleNamespace, task_of_two_curves: SimpleNamespace
) -> None:
    charging, task = plain.charging, task_of_two_curves
    fast = charging.Charge(100.0, charging.level_at(task, 100.0), 2_000.0, 100_000.0)
    ends_early = charging.Charge(100.0, charging.level_at(task, 100.0), 300.0, 40_000.0)
    slow = charging.Charge(2_041.0, 5_000.0, 2_500.0, 20_000.0)

    assert charging.worth_staying_s(task, fast, 1) == 400.0
    assert charging.worth_staying_s(task, ends_early, 1) == 200.0
    assert charging.worth_staying_s(task, fast, 0) == 0.0
    assert charging.worth_staying_s(task, slow, 0) == 0.0
    assert charging.worth_staying_s(task, slow, 1) == 0.0


@pytest.mark.parametrize("curves", ["task", "task_of_two_curves"])
def test_a_dominating_label_has_at_least_as_much_charge_at_every_moment(
    plain: SimpleNamespace, request: pytest.FixtureRequest, curves: str
) -> None:
    task: SimpleNamespace = request.getfixturevalue(curves)
    random = np.random.default_rng(3)
    rows = [_label(plain, task, random) for _ in range(60)]
    dominating = 0
    for one in rows:
        for other in rows:
            at_s = np.linspace(other[0], other[0] + other[3] - other[1], 25)
            bends = other[0] + task.curve_s - other[1]
            at_s = np.append(at_s, bends[(bends > at_s[0]) & (bends < at_s[-1])])
            leads = [
                _charge_j(plain, task, one, s) - _charge_j(plain, task, other, s) for s in at_s
            ]
            expected = one[0] <= other[0] and min(leads) >= -1e-6
            assert plain.dominance.dominates(task, one, other, 0.0) == expected
            dominating += expected
    assert dominating > len(rows)


def test_a_label_that_is_later_dominates_only_if_its_drone_is_full_no_later_on_any_pad(
    plain: SimpleNamespace, task: SimpleNamespace
) -> None:
    fastest = (500 - 40) / (0.55 * 100_000)
    full = SimpleNamespace(**vars(task) | {"lag_s_per_j": fastest, "recharges_fully": True})
    random = np.random.default_rng(5)
    later = 0
    for _ in range(300):
        one, other = (_charged_to_the_top(task, random) for _ in range(2))
        if one[0] > other[0] and plain.dominance.dominates(full, one, other, 100.0):
            later += 1
            assert not plain.dominance.dominates(full, one, other, 0.0)
            for flight in random.uniform(0, 1, 50):
                window = other[0] + np.cumsum(random.uniform(0, 2_500, 2))
                full_at = [
                    _full_at_s(plain, task, row, flight * (95_000 - other[5]), window)
                    for row in (one, other)
                ]
                assert full_at[0] <= full_at[1]
    assert later > 10


@pytest.mark.parametrize("curves", ["task", "task_of_two_curves"])
def test_a_label_that_is_later_dominates_only_if_its_drone_catches_up_on_all_pads(
    plain: SimpleNamespace, request: pytest.FixtureRequest, curves: str
) -> None:
    fastest = {"lag_s_per_j": (500 - 40) / (0.55 * 100_000), "recharges_fully": False}
    task = SimpleNamespace(**vars(request.getfixturevalue(curves)) | fastest)
    random = np.random.default_rng(6)
    later = 0
    for _ in range(4_000):
        one, other = (_label(plain, task, random) for _ in range(2))
        missing_j = random.uniform(0, 40_000)
        is_flying = other[2] - other[5] >= task.reserve_j
        if not is_flying or one[0] <= other[0]:
            continue
        if not plain.dominance.dominates(task, one, other, missing_j):
            continue
        later += 1
        for _ in range(10):
            _assert_catches_up(plain, task, one, other, missing_j, random)
    assert later > 50


def _assert_catches_up(
    plain: SimpleNamespace,
    task: SimpleNamespace,
    one: NDArray[np.float64],
    other: NDArray[np.float64],
    missing_j: float,
    random: np.random.Generator,
) -> None:
    """The drone of `other` flies and charges; that of `one` follows and takes the same pads."""
    charging, curves = plain.charging, len(task.curve_offsets) - 1
    stays_s = random.uniform(0, other[3] - other[1])
    times_s = np.array([one[0], other[0]]) + stays_s
    charges_j = [_charge_j(plain, task, row, row[0] + stays_s) for row in (one, other)]
    charged_j = 0.0
    while charged_j < missing_j:
        flown_j = random.uniform(0, max(0.0, charges_j[1] - task.reserve_j))
        charges_j = [each - flown_j for each in charges_j]
        begins_s = times_s[1] + random.choice([0.0, 50.0])
        curve = random.integers(0, curves)
        before_j, ends_s = charges_j[1], begins_s + random.uniform(0, 400)
        for drone in (0, 1):
            if times_s[drone] < ends_s:
                place = charging.position_of(task, curve, charges_j[drone])
                place += ends_s - max(times_s[drone], begins_s)
                last = task.curve_s[task.curve_offsets[curve + 1] - 1]
                charges_j[drone] = charging.level_at(task, min(place, last))
                times_s[drone] = ends_s
        charged_j += charges_j[1] - before_j
    assert times_s[0] <= times_s[1] + 1e-6
    assert charges_j[0] >= charges_j[1] - 1e-3


def _charged_to_the_top(task: SimpleNamespace, random: np.random.Generator) -> NDArray[np.float64]:
    end_s, top_j = task.curve_s[-1], task.curve_j[-1]
    time_s, used_j = random.uniform(0, 800), random.uniform(0, 90_000)
    return np.array([time_s, end_s, top_j, end_s, top_j, used_j, np.inf, -np.inf])


def _full_at_s(
    plain: SimpleNamespace,
    task: SimpleNamespace,
    row: NDArray[np.float64],
    flown_j: float,
    window: NDArray[np.float64],
) -> float:
    """When the drone is full on a pad that is free in this window; inf if it cannot be."""
    level_j = row[4] - row[5] - flown_j
    takes_s = task.curve_s[-1] - plain.charging.position_of(task, 0, level_j)
    # The flight takes as long for all rows, so any number is as good as 0.
    end_s = max(row[0], window[0]) + takes_s
    return float(end_s) if end_s <= window[1] else np.inf


def _label(
    plain: SimpleNamespace, task: SimpleNamespace, random: np.random.Generator
) -> NDArray[np.float64]:
    curve = random.integers(0, len(task.curve_offsets) - 1)
    begins_s = task.curve_s[task.curve_offsets[curve]]
    ends_s = task.curve_s[task.curve_offsets[curve + 1] - 1]
    first, last = np.sort(random.uniform(begins_s, ends_s, 2))
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
