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


class Receiver:
    """An autopilot that gets messages, and a wall clock that tests move."""

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

    def fix(self, fix_type: int = 3, *, kind: str = "gps_raw_int") -> None:
        zeros = (0,) * (9 if kind == "gps2_raw" else 8)
        message = getattr(self.mav, f"MAVLink_{kind}_message")
        self.autopilot.handle(message(0, fix_type, *zeros, *((0,) if kind == "gps2_raw" else ())))

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
def receiver(drone: Any, dialect: Any) -> Receiver:
    return Receiver(drone.model, dialect)


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
    receiver: Receiver, order: tuple[int, int], flight: int, other: int
) -> None:
    for _ in range(3):
        receiver.pass_s(1.0)
        for number in order:
            if number == 0:
                receiver.battery(0, flight, remaining=20)
            else:
                receiver.battery(1, other, cells_mv=(4100,) * 3, remaining=95)

    reading = receiver.reading()
    assert (receiver.autopilot.soc, reading.voltage_v) == pytest.approx((0.2, 21.6))
    assert reading.has_battery


def test_a_flight_battery_may_have_a_later_id_than_a_payload_battery(receiver: Receiver) -> None:
    receiver.battery(0, PAYLOAD, remaining=95)
    receiver.battery(3, PROPULSION, remaining=20)

    assert receiver.autopilot.soc == 0.2


def test_without_a_flight_battery_the_charge_is_unknown(receiver: Receiver) -> None:
    receiver.battery(1, PAYLOAD, remaining=95)

    assert receiver.autopilot.soc is None
    assert not receiver.reading().has_battery


def test_of_two_flight_batteries_the_emptiest_counts_and_powers_add_up(receiver: Receiver) -> None:
    receiver.battery(0, PROPULSION, remaining=60, current_ca=1000, used_hj=100)
    receiver.battery(1, PROPULSION, remaining=50, current_ca=1000, used_hj=200)

    reading = receiver.reading()
    assert receiver.autopilot.soc == 0.5
    assert reading.power_w == pytest.approx(2 * 21.6 * 10.0)
    assert reading.consumed_j == 30_000.0


def test_sys_status_counts_only_while_no_battery_reports_by_its_id(receiver: Receiver) -> None:
    receiver.system(remaining=95, mv=12_300)
    assert receiver.autopilot.soc == 0.95

    receiver.battery(0, PROPULSION, remaining=20)
    receiver.system(remaining=95, mv=12_300)
    assert (receiver.autopilot.soc, receiver.reading().voltage_v) == pytest.approx((0.2, 21.6))

    receiver.pass_s(60.0)
    receiver.system(remaining=95, mv=12_300)
    assert receiver.autopilot.soc is None


def test_a_silent_battery_is_unknown_and_its_charge_counts_down(
    receiver: Receiver, drone: Any
) -> None:
    receiver.battery(0, PROPULSION, remaining=20, current_ca=2000)
    used_j = receiver.reading().consumed_j
    receiver.battery(1, UNKNOWN, remaining=95)
    receiver.pass_s(100.0)
    receiver.battery(1, UNKNOWN, remaining=95)

    reading = receiver.reading(soc=0.9)
    drawn_j = 21.6 * 20.0 * 100.0
    assert receiver.autopilot.soc is None
    assert not reading.has_battery
    assert reading.consumed_j - used_j == pytest.approx(drawn_j)
    expected = 0.2 - drawn_j / drone.model.battery_j
    assert receiver.autopilot.least_soc(0.9) == pytest.approx(expected)


def test_a_value_that_the_newest_message_does_not_know_is_unknown(receiver: Receiver) -> None:
    receiver.battery(remaining=80, temperature=4_000, current_ca=2_000)
    receiver.battery(cells_mv=(), remaining=-1, current_ca=-1)

    reading = receiver.reading(soc=0.8)
    assert receiver.autopilot.soc is None
    assert not reading.has_battery
    assert (reading.current_a, reading.temperature_c) == (0.0, 25.0)
    assert reading.voltage_v == pytest.approx(BatteryPack().open_voltage_v(0.8))


def test_cells_of_the_second_range_count(receiver: Receiver) -> None:
    receiver.battery(cells_mv=(3700,) * 10, more_mv=(3600, 3700), remaining=50)

    reading = receiver.reading()
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
    receiver: Receiver, cells_mv: Any, volts: float, cells: int
) -> None:
    receiver.battery(cells_mv=cells_mv, remaining=50)

    reading = receiver.reading()
    assert (reading.voltage_v, reading.cells) == pytest.approx((volts, cells))
    assert reading.cell_low_v == reading.cell_high_v == pytest.approx(volts / cells)


def test_the_energy_goes_on_when_the_autopilot_counts_in_another_unit(receiver: Receiver) -> None:
    receiver.battery(used_hj=500, used_mah=900, remaining=80)
    receiver.battery(used_hj=510, used_mah=920, remaining=79)
    receiver.battery(used_hj=-1, used_mah=930, remaining=79)
    receiver.battery(used_hj=-1, used_mah=-1, remaining=79)

    assert receiver.reading().consumed_j == pytest.approx(51_000.0 + 10 * 3.6 * 21.6)


@pytest.mark.parametrize("two", [False, True])
def test_the_estimate_on_board_follows_the_flight_battery_for_15_minutes(
    receiver: Receiver, drone: Any, two: bool
) -> None:
    pack, battery_j = BatteryPack(), 2_000_000.0
    estimate = BatteryEstimate(pack, soc=0.8, error=0.02)
    true_soc, used_mah = 0.8, 0.0
    for _ in range(900):
        receiver.pass_s(1.0)
        volts = pack.open_voltage_v(true_soc) - 0.6
        used_mah += 600 / volts / 3.6
        true_soc -= 600 / battery_j
        cells = (round(volts / 6 * 1000),) * 6
        current_ca, remaining = round(60_000 / volts), round(true_soc * 100)
        receiver.battery(
            0, cells_mv=cells, current_ca=current_ca, used_mah=round(used_mah), remaining=remaining
        )
        if two:
            receiver.battery(1, cells_mv=(4100,) * 3, current_ca=20, used_mah=5, remaining=95)
        estimate.update(receiver.reading(0.8), capacity_j=battery_j, capacity_error=0.02)

    assert receiver.autopilot.soc == pytest.approx(true_soc, abs=0.01)
    assert estimate.soc == pytest.approx(true_soc, abs=0.03)


# Positions


def test_a_drone_is_not_ready_before_its_first_fix(receiver: Receiver) -> None:
    receiver.beat()
    receiver.stands()
    receiver.fix(0)
    receiver.place(0, 0)
    receiver.place(298_832_700, -979_413_900)

    assert not receiver.autopilot.has_reported
    assert receiver.reading().position == HERE

    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900)

    assert receiver.autopilot.has_reported
    assert receiver.reading().position == Position(-97.94139, 29.88327)


@pytest.mark.parametrize(
    "place", [(0, 0), (2_147_483_647, 2_147_483_647), (900_000_001, 0), (0, -1_800_000_001)]
)
def test_no_place_is_no_place_with_a_fix_either(receiver: Receiver, place: tuple[int, int]) -> None:
    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900)
    receiver.pass_s(6.0)
    receiver.fix(3)
    receiver.place(*place)

    assert receiver.autopilot.position == Position(-97.94139, 29.88327)
    assert not receiver.reading().has_gps


@pytest.mark.parametrize("fix_type", [0, 1, 2, 9, 255])
def test_a_lost_fix_keeps_the_last_position(receiver: Receiver, fix_type: int) -> None:
    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900)
    receiver.fix(fix_type)
    receiver.place(299_000_000, -979_413_900)

    assert receiver.autopilot.position == Position(-97.94139, 29.88327)
    assert not receiver.reading().has_gps


def test_a_second_receiver_gives_a_fix_too(receiver: Receiver) -> None:
    receiver.fix(1)
    receiver.fix(4, kind="gps2_raw")
    receiver.place(298_832_700, -979_413_900)

    assert receiver.reading().has_gps


@pytest.mark.parametrize("silent", ["fix", "place"])
def test_a_silent_source_of_positions_means_no_gps(receiver: Receiver, silent: str) -> None:
    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900)
    receiver.pass_s(6.0)
    if silent != "fix":
        receiver.fix(3)
    if silent != "place":
        receiver.place(298_832_700, -979_413_900)

    assert not receiver.reading().has_gps


# Speeds, states and missions


def test_an_unknown_ground_speed_makes_no_wind(receiver: Receiver, dialect: Any) -> None:
    receiver.fix(3)
    receiver.autopilot.handle(dialect.MAVLink_vfr_hud_message(15.0, 0.0, 90, 0, 0.0, 0.0))
    receiver.place(298_832_700, -979_413_900, north=32_767)

    assert receiver.reading().ground_mps == receiver.reading().air_mps == (0.0, 0.0)


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
    receiver: Receiver, dialect: Any, airspeed: float, heading: int, waited_s: float
) -> None:
    receiver.autopilot.handle(dialect.MAVLink_vfr_hud_message(airspeed, 0.0, heading, 0, 0.0, 0.0))
    receiver.pass_s(waited_s)
    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900, north=300, east=400)

    assert receiver.reading().air_mps == (4.0, 3.0)


@pytest.mark.parametrize(
    ("wind", "waited_s"),
    [((float("nan"), 2.0), 0.0), ((1.0, float("inf")), 0.0), ((1.0, 2.0), 6.0)],
)
def test_an_unknown_or_old_wind_is_no_wind(
    receiver: Receiver, dialect: Any, wind: tuple[float, float], waited_s: float
) -> None:
    receiver.autopilot.handle(dialect.MAVLink_wind_cov_message(0, *wind, 0, 0, 0, 0, 0, 0))
    receiver.pass_s(waited_s)
    receiver.fix(3)
    receiver.place(298_832_700, -979_413_900, north=300, east=400)

    assert receiver.reading().air_mps == (4.0, 3.0)


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
    receiver: Receiver, kind: int, autopilot: int
) -> None:
    receiver.beat(mode=128)
    receiver.beat(kind=kind, autopilot=autopilot, mode=0, state=6)

    assert receiver.autopilot.is_armed
    assert (receiver.autopilot.kind, receiver.autopilot.state) == (3, 4)


@pytest.mark.parametrize(("state", "work"), [(4, True), (5, True), (6, False), (8, False)])
def test_a_terminated_flight_has_no_motors(receiver: Receiver, state: int, work: bool) -> None:
    receiver.beat(state=state)

    assert receiver.reading().motors_work is work


def test_a_landed_state_that_is_no_longer_repeated_gives_way_to_the_armed_flag(
    receiver: Receiver,
) -> None:
    receiver.stands()
    receiver.beat(mode=128)
    assert receiver.autopilot.is_on_ground

    receiver.pass_s(6.0)
    receiver.beat(mode=128)

    assert not receiver.autopilot.is_on_ground


def test_an_item_of_no_mission_is_no_item(receiver: Receiver, dialect: Any) -> None:
    receiver.autopilot.handle(dialect.MAVLink_mission_current_message(5, 65_535))
    assert receiver.autopilot.item_now is None

    receiver.autopilot.handle(dialect.MAVLink_mission_current_message(5, 9))
    assert receiver.autopilot.item_now == 5
