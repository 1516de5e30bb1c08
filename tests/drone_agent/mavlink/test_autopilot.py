"""The values of an autopilot: only its own, only known ones, and only while it repeats them."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from skyway_drone_agent.analysis.battery_charge import BatteryEstimate
from skyway_drone_agent.mavlink.autopilot import Autopilot
from skyway_drone_agent.vehicle import BatteryPack, Reading

from skyway.geo import Position

HERE = Position(-98.0, 29.6)
UNKNOWN, ALL, PROPULSION, AVIONICS, PAYLOAD = range(5)


@pytest.fixture(scope="module")
def dialect() -> Any:
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v20 import common

    return common


class Heard:
    """An autopilot that hears messages, and a wall clock that tests move."""

    def __init__(self, model: Any, dialect: Any) -> None:
        self.now = datetime(2026, 11, 28, tzinfo=UTC)
        self.mav = dialect
        clock: Any = SimpleNamespace(wall_now=lambda: self.now, now=lambda: self.now)
        self.autopilot = Autopilot(model, dialect, clock)

    def pass_s(self, seconds: float) -> None:
        self.now += timedelta(seconds=seconds)

    def reading(self, soc: float = 0.5) -> Reading:
        return self.autopilot.reading(self.now, last_position=HERE, last_soc=soc)

    def battery(
        self,
        number: int = 0,
        function: int = UNKNOWN,
        *,
        cells_mv: Any = (3600,) * 6,
        more_mv: Any = (),
        current_ca: int = -1,
        used_mah: int = -1,
        used_hj: int = -1,
        remaining: int = -1,
        temperature: int = 32_767,
    ) -> None:
        cells = ([*cells_mv] + [65_535] * 10)[:10]
        more = ([*more_mv] + [0] * 4)[:4]
        numbers = (temperature, cells, current_ca, used_mah, used_hj, remaining)
        self.autopilot.handle(
            self.mav.MAVLink_battery_status_message(number, function, 1, *numbers, 0, 0, more, 0, 0)
        )

    def system(self, *, remaining: int = -1, mv: int = 65_535, current_ca: int = -1) -> None:
        self.autopilot.handle(
            self.mav.MAVLink_sys_status_message(
                0, 0, 0, 0, mv, current_ca, remaining, 0, 0, 0, 0, 0, 0
            )
        )

    def fix(self, fix_type: int = 3, *, receiver: str = "gps_raw_int") -> None:
        zeros = (0,) * (9 if receiver == "gps2_raw" else 8)
        message = getattr(self.mav, f"MAVLink_{receiver}_message")
        self.autopilot.handle(
            message(0, fix_type, *zeros, *((0,) if receiver == "gps2_raw" else ()))
        )

    def place(self, latitude: int, longitude: int, *, north: int = 0, east: int = 0) -> None:
        self.autopilot.handle(
            self.mav.MAVLink_global_position_int_message(
                0, latitude, longitude, 0, 0, north, east, 0, 65_535
            )
        )

    def beat(self, *, kind: int = 2, autopilot: int = 3, mode: int = 0, state: int = 4) -> None:
        self.autopilot.handle(
            self.mav.MAVLink_heartbeat_message(kind, autopilot, mode, 0, state, 3)
        )

    def stands(self, state: int = 1) -> None:
        self.autopilot.handle(self.mav.MAVLink_extended_sys_state_message(0, state))


@pytest.fixture
def heard(drone: Any, dialect: Any) -> Heard:
    return Heard(drone.model, dialect)


# Batteries


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize(
    ("flight", "other"),
    [
        (PROPULSION, PAYLOAD),
        (ALL, AVIONICS),
        (UNKNOWN, PAYLOAD),
        (PROPULSION, UNKNOWN),
        (UNKNOWN,) * 2,
    ],
)
def test_the_charge_is_that_of_the_flight_battery(
    heard: Heard, order: tuple[int, int], flight: int, other: int
) -> None:
    for _ in range(3):
        heard.pass_s(1.0)
        for number in order:
            if number == 0:
                heard.battery(0, flight, remaining=20)
            else:
                heard.battery(1, other, cells_mv=(4100,) * 3, remaining=95)

    reading = heard.reading()
    assert (heard.autopilot.soc, reading.voltage_v) == pytest.approx((0.2, 21.6))
    assert reading.has_battery


def test_a_flight_battery_may_have_a_later_id_than_a_payload_battery(heard: Heard) -> None:
    heard.battery(0, PAYLOAD, remaining=95)
    heard.battery(3, PROPULSION, remaining=20)

    assert heard.autopilot.soc == 0.2


def test_without_a_flight_battery_the_charge_is_unknown(heard: Heard) -> None:
    heard.battery(1, PAYLOAD, remaining=95)

    assert heard.autopilot.soc is None
    assert not heard.reading().has_battery


def test_of_two_flight_batteries_the_emptiest_counts_and_powers_add_up(heard: Heard) -> None:
    heard.battery(0, PROPULSION, remaining=60, current_ca=1000, used_hj=100)
    heard.battery(1, PROPULSION, remaining=50, current_ca=1000, used_hj=200)

    reading = heard.reading()
    assert heard.autopilot.soc == 0.5
    assert reading.power_w == pytest.approx(2 * 21.6 * 10.0)
    assert reading.consumed_j == 30_000.0


def test_sys_status_counts_only_while_no_battery_reports_by_its_id(heard: Heard) -> None:
    heard.system(remaining=95, mv=12_300)
    assert heard.autopilot.soc == 0.95

    heard.battery(0, PROPULSION, remaining=20)
    heard.system(remaining=95, mv=12_300)
    assert (heard.autopilot.soc, heard.reading().voltage_v) == pytest.approx((0.2, 21.6))

    heard.pass_s(60.0)
    heard.system(remaining=95, mv=12_300)
    assert heard.autopilot.soc is None


def test_a_silent_battery_is_unknown_and_its_charge_counts_down(heard: Heard, drone: Any) -> None:
    heard.battery(0, PROPULSION, remaining=20, current_ca=2000)
    used_j = heard.reading().consumed_j
    heard.battery(1, UNKNOWN, remaining=95)
    heard.pass_s(100.0)
    heard.battery(1, UNKNOWN, remaining=95)

    reading = heard.reading(soc=0.9)
    drawn_j = 21.6 * 20.0 * 100.0
    assert heard.autopilot.soc is None
    assert not reading.has_battery
    assert reading.consumed_j - used_j == pytest.approx(drawn_j)
    expected = 0.2 - drawn_j / drone.model.battery_j
    assert heard.autopilot.least_soc(0.9) == pytest.approx(expected)


def test_a_value_that_the_newest_message_does_not_know_is_unknown(heard: Heard) -> None:
    heard.battery(remaining=80, temperature=4_000, current_ca=2_000)
    heard.battery(cells_mv=(), remaining=-1, current_ca=-1)

    reading = heard.reading(soc=0.8)
    assert heard.autopilot.soc is None
    assert not reading.has_battery
    assert (reading.current_a, reading.temperature_c) == (0.0, 25.0)
    assert reading.voltage_v == pytest.approx(BatteryPack().open_voltage_v(0.8))


def test_cells_of_the_second_range_count(heard: Heard) -> None:
    heard.battery(cells_mv=(3700,) * 10, more_mv=(3600, 3700), remaining=50)

    reading = heard.reading()
    assert (reading.cells, reading.voltage_v) == pytest.approx((12, 11 * 3.7 + 3.6))
    assert (reading.cell_low_v, reading.cell_high_v) == (3.6, 3.7)


@pytest.mark.parametrize(
    ("cells_mv", "volts", "cells"),
    [
        ((22_200,), 22.2, 6),
        ((44_400,), 44.4, 12),
        ((65_534, 1_066), 66.6, 18),
        ((11_400,), 11.4, 3),
    ],
)
def test_the_voltage_of_a_whole_battery_is_not_that_of_a_cell(
    heard: Heard, cells_mv: Any, volts: float, cells: int
) -> None:
    heard.battery(cells_mv=cells_mv, remaining=50)

    reading = heard.reading()
    assert (reading.voltage_v, reading.cells) == pytest.approx((volts, cells))
    assert reading.cell_low_v == reading.cell_high_v == pytest.approx(volts / cells)


def test_the_energy_goes_on_when_the_autopilot_counts_in_another_unit(heard: Heard) -> None:
    heard.battery(used_hj=500, used_mah=900, remaining=80)
    heard.battery(used_hj=510, used_mah=920, remaining=79)
    heard.battery(used_hj=-1, used_mah=930, remaining=79)
    heard.battery(used_hj=-1, used_mah=-1, remaining=79)

    assert heard.reading().consumed_j == pytest.approx(51_000.0 + 10 * 3.6 * 21.6)


@pytest.mark.parametrize("two", [False, True])
def test_the_estimate_on_board_follows_the_flight_battery_for_15_minutes(
    heard: Heard, drone: Any, two: bool
) -> None:
    pack, battery_j = BatteryPack(), 2_000_000.0
    estimate = BatteryEstimate(pack, soc=0.8, error=0.02)
    true_soc, used_mah = 0.8, 0.0
    for _ in range(900):
        heard.pass_s(1.0)
        volts = pack.open_voltage_v(true_soc) - 0.6
        used_mah += 600 / volts / 3.6
        true_soc -= 600 / battery_j
        cells = (round(volts / 6 * 1000),) * 6
        current_ca, remaining = round(60_000 / volts), round(true_soc * 100)
        heard.battery(
            0, cells_mv=cells, current_ca=current_ca, used_mah=round(used_mah), remaining=remaining
        )
        if two:
            heard.battery(1, cells_mv=(4100,) * 3, current_ca=20, used_mah=5, remaining=95)
        estimate.update(heard.reading(0.8), capacity_j=battery_j, capacity_error=0.02)

    assert heard.autopilot.soc == pytest.approx(true_soc, abs=0.01)
    assert estimate.soc == pytest.approx(true_soc, abs=0.03)


# Positions


def test_a_drone_is_not_ready_before_its_first_fix(heard: Heard) -> None:
    heard.beat()
    heard.stands()
    heard.fix(0)
    heard.place(0, 0)
    heard.place(298_832_700, -979_413_900)

    assert not heard.autopilot.has_reported
    assert heard.reading().position == HERE

    heard.fix(3)
    heard.place(298_832_700, -979_413_900)

    assert heard.autopilot.has_reported
    assert heard.reading().position == Position(-97.94139, 29.88327)


@pytest.mark.parametrize(
    "place", [(0, 0), (2_147_483_647, 2_147_483_647), (900_000_001, 0), (0, -1_800_000_001)]
)
def test_no_place_is_no_place_with_a_fix_either(heard: Heard, place: tuple[int, int]) -> None:
    heard.fix(3)
    heard.place(298_832_700, -979_413_900)
    heard.pass_s(6.0)
    heard.fix(3)
    heard.place(*place)

    assert heard.autopilot.position == Position(-97.94139, 29.88327)
    assert not heard.reading().has_gps


@pytest.mark.parametrize("fix_type", [0, 1, 2, 9, 255])
def test_a_lost_fix_keeps_the_last_position(heard: Heard, fix_type: int) -> None:
    heard.fix(3)
    heard.place(298_832_700, -979_413_900)
    heard.fix(fix_type)
    heard.place(299_000_000, -979_413_900)

    assert heard.autopilot.position == Position(-97.94139, 29.88327)
    assert not heard.reading().has_gps


def test_a_second_receiver_gives_a_fix_too(heard: Heard) -> None:
    heard.fix(1)
    heard.fix(4, receiver="gps2_raw")
    heard.place(298_832_700, -979_413_900)

    assert heard.reading().has_gps


@pytest.mark.parametrize("silent", ["fix", "place"])
def test_a_silent_source_of_positions_means_no_gps(heard: Heard, silent: str) -> None:
    heard.fix(3)
    heard.place(298_832_700, -979_413_900)
    heard.pass_s(6.0)
    if silent != "fix":
        heard.fix(3)
    if silent != "place":
        heard.place(298_832_700, -979_413_900)

    assert not heard.reading().has_gps


# Speeds, states and missions


def test_an_unknown_ground_speed_makes_no_wind(heard: Heard, dialect: Any) -> None:
    heard.fix(3)
    heard.autopilot.handle(dialect.MAVLink_vfr_hud_message(15.0, 0.0, 90, 0, 0.0, 0.0))
    heard.place(298_832_700, -979_413_900, north=32_767)

    assert heard.reading().ground_mps == heard.reading().air_mps == (0.0, 0.0)


@pytest.mark.parametrize(
    ("airspeed", "heading", "waited_s"),
    [
        (float("nan"), 90, 0.0),
        (15.0, -1, 0.0),
        (15.0, 32_767, 0.0),
        (15.0, 90, 6.0),
        (0.0, 90, 0.0),
    ],
)
def test_an_unknown_air_speed_is_the_ground_speed(
    heard: Heard, dialect: Any, airspeed: float, heading: int, waited_s: float
) -> None:
    heard.autopilot.handle(dialect.MAVLink_vfr_hud_message(airspeed, 0.0, heading, 0, 0.0, 0.0))
    heard.pass_s(waited_s)
    heard.fix(3)
    heard.place(298_832_700, -979_413_900, north=300, east=400)

    assert heard.reading().air_mps == (4.0, 3.0)


@pytest.mark.parametrize(
    ("wind", "waited_s"),
    [((float("nan"), 2.0), 0.0), ((1.0, float("inf")), 0.0), ((1.0, 2.0), 6.0)],
)
def test_an_unknown_or_old_wind_is_no_wind(
    heard: Heard, dialect: Any, wind: tuple[float, float], waited_s: float
) -> None:
    heard.autopilot.handle(dialect.MAVLink_wind_cov_message(0, *wind, 0, 0, 0, 0, 0, 0))
    heard.pass_s(waited_s)
    heard.fix(3)
    heard.place(298_832_700, -979_413_900, north=300, east=400)

    assert heard.reading().air_mps == (4.0, 3.0)


@pytest.mark.parametrize(
    ("kind", "autopilot"),
    [(6, 8), (18, 8), (26, 8), (30, 8), (26, 0), (30, 0), (5, 3), (10, 3), (2, 8)],
    ids=[
        "person",
        "companion",
        "gimbal",
        "camera",
        "gimbal0",
        "camera0",
        "tracker",
        "rover",
        "none",
    ],
)
def test_a_heartbeat_of_something_else_says_nothing_about_the_drone(
    heard: Heard, kind: int, autopilot: int
) -> None:
    heard.beat(mode=128)
    heard.beat(kind=kind, autopilot=autopilot, mode=0, state=6)

    assert heard.autopilot.is_armed
    assert (heard.autopilot.kind, heard.autopilot.state) == (3, 4)


@pytest.mark.parametrize(("state", "work"), [(4, True), (5, True), (6, False), (8, False)])
def test_a_terminated_flight_has_no_motors(heard: Heard, state: int, work: bool) -> None:
    heard.beat(state=state)

    assert heard.reading().motors_work is work


def test_a_landed_state_that_is_no_longer_repeated_gives_way_to_the_armed_flag(
    heard: Heard,
) -> None:
    heard.stands()
    heard.beat(mode=128)
    assert heard.autopilot.is_on_ground

    heard.pass_s(6.0)
    heard.beat(mode=128)

    assert not heard.autopilot.is_on_ground


def test_an_item_of_no_mission_is_no_item(heard: Heard, dialect: Any) -> None:
    heard.autopilot.handle(dialect.MAVLink_mission_current_message(5, 65_535))
    assert heard.autopilot.item_now is None

    heard.autopilot.handle(dialect.MAVLink_mission_current_message(5, 9))
    assert heard.autopilot.item_now == 5
