"""Long lists of reservations, read by the column, give what reading one by one gives."""

import copy
import pickle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.errors import FieldFault, InvalidProblem
from skyway.planner import compose
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.planner.reservations import ReservationColumns

#: More than are read one by one in any case.
COUNT = 40
STATIONS = "abcd"
ODD_VALUES: list[Any] = [
    None, {}, [], True, False, "", "a", "x", "a b", "0", "a\n", "é", "x" * 65, 0, 1, 2, -1, 3, 999,
    1000, 0.0, -0.0, 2.0, 2.5, 10**11, -(10**11), 10**400, float("nan"), float("inf"),
]  # fmt: skip
NAMES = ["station_id", "pad", "start_s", "end_s", "surprise"]


def reservations(count: int = COUNT) -> list[dict[str, Any]]:
    """Reservations of three pads of each of four stations, one after another."""
    made = []
    for number in range(count):
        place, turn = number % 12, number // 12
        end_s = None if turn == (count - 1 - place) // 12 else 10.0 * turn + 10
        made.append(
            {
                "station_id": STATIONS[place % 4],
                "pad": place // 4,
                "start_s": 10.0 * turn,
                "end_s": end_s,
            }
        )
    return made


@pytest.fixture(scope="session")
def document(good_problem, make_network) -> dict[str, Any]:
    network = make_network("a-b:1 b-c:1 c-d:1")
    packages = [{"package_id": "p1", "mass_kg": 0.1, "destination": "d"}]
    return {"network": network, "drone": good_problem["drone"], "source": "a", "packages": packages}


def read(document: dict[str, Any], held: Any) -> Problem | tuple[FieldFault, ...]:
    """The problem with these reservations, or its faults."""
    try:
        return read_problem(document | {"pad_reservations": held})
    except InvalidProblem as error:
        return error.faults


def assert_same(document: dict[str, Any], held: list[Any]) -> None:
    """Only lists are read by the column; a tuple is read one by one."""
    by_column, one_by_one = read(document, held), read(document, tuple(held))
    if not isinstance(by_column, Problem) or not isinstance(one_by_one, Problem):
        assert by_column == one_by_one
        return
    assert isinstance(one_by_one.pad_reservations, tuple)
    assert by_column == one_by_one
    assert by_column.model_dump_json() == one_by_one.model_dump_json()
    books = [PadBook.of(one.network, one.pad_reservations) for one in (by_column, one_by_one)]
    for name in ("station", "pad", "start_ms", "end_ms"):
        assert getattr(books[0], name).tolist() == getattr(books[1], name).tolist()


@pytest.mark.parametrize(("count", "kind"), [(COUNT, ReservationColumns), (3, tuple)])
def test_a_long_list_is_kept_as_columns_and_a_short_one_as_a_tuple(document, count, kind):
    problem = read_problem(document | {"pad_reservations": reservations(count)})

    assert isinstance(problem.pad_reservations, kind)


@pytest.mark.parametrize("name", NAMES)
def test_each_single_change_gives_the_same_problem_or_the_same_faults(document, name: str):
    for number in (0, 17, COUNT - 1):
        missing = reservations()
        missing[number].pop(name, None)
        assert_same(document, missing)
        for value in ODD_VALUES:
            changed = reservations()
            changed[number][name] = value
            assert_same(document, changed)


def test_each_odd_reservation_gives_the_same_faults(document):
    for value in ODD_VALUES:
        assert_same(document, [*reservations(), value])


def test_a_reservation_too_many_gives_the_same_fault(document):
    assert_same(document, [reservations(1)[0]] * 100_001)


MOMENTS = st.one_of(
    st.integers(-5, 60),
    st.floats(-5.0, 60.0),
    st.integers(-5, 60).map(lambda moment_s: moment_s + 4e-7),
)
RESERVATIONS = st.fixed_dictionaries(
    {"station_id": st.sampled_from(STATIONS), "pad": st.integers(0, 3), "start_s": MOMENTS},
    optional={"end_s": st.one_of(st.none(), MOMENTS)},
)


@settings(max_examples=100, deadline=None)
@given(
    others=st.lists(RESERVATIONS, max_size=8),
    late_s=st.sampled_from([0.0, 4e-7, -4e-7, 1.0]),
    order=st.randoms(use_true_random=False),
)
def test_any_list_gives_the_same_problem_or_the_same_faults(document, others, late_s, order):
    held = copy.deepcopy(reservations())
    held[0]["start_s"] += late_s
    held[0]["end_s"] += late_s
    held += others
    order.shuffle(held)

    assert_same(document, held)


def test_a_plan_around_columns_is_the_plan_around_the_same_tuple(document):
    held = reservations()
    by_column, one_by_one = (
        compose(read_problem(document | {"pad_reservations": given}))
        for given in (held, tuple(held))
    )

    assert by_column.steps == one_by_one.steps


def test_columns_can_be_sliced_copied_and_sent_to_another_process(document):
    columns = read_problem(document | {"pad_reservations": reservations()}).pad_reservations

    assert columns[2:4] == tuple(columns)[2:4]
    assert columns[-1] == tuple(columns)[-1]
    assert pickle.loads(pickle.dumps(columns)) == columns
