"""The schedule of faults, the same for the same seed."""

from itertools import islice

import pytest
from skyway_lab.benchmarks.chaos.fault_kinds import KINDS
from skyway_lab.benchmarks.chaos.faults.acting import FAULTS
from skyway_lab.benchmarks.chaos.schedule import faults_for, schedule

from skyway.errors import SkywayError


def test_the_same_seed_gives_the_same_faults_and_another_seed_others() -> None:
    faults = faults_for("production", is_root=True)

    first, again, other = (list(islice(schedule(faults, seed=seed), 30)) for seed in (3, 3, 4))

    assert first == again
    assert [each.name for each in first] != [each.name for each in other]


def test_every_fault_comes_before_one_comes_again() -> None:
    faults = faults_for("embedded", is_root=True)

    deck = list(islice(schedule(faults, seed=1), len(faults)))

    assert sorted(each.name for each in deck) == sorted(f"{kind.name}: {it}" for kind, it in faults)
    assert all(each.kind.lasts_s[0] <= each.lasts_s <= each.kind.lasts_s[1] for each in deck)


def test_faults_are_chosen_by_kind_or_name_and_left_out() -> None:
    faults = faults_for(
        "embedded", only=("kill", "freeze: broker"), without=("kill: everything",), is_root=True
    )

    names = {f"{kind.name}: {target}" for kind, target in faults}
    assert names == {
        *(f"kill: {it}" for it in ("gateway", "composition", "registry", "broker", "drones")),
        "freeze: broker",
    }


def test_an_unknown_fault_is_refused_with_all_names() -> None:
    with pytest.raises(SkywayError, match=r"is called kil; there are away, away: broker"):
        faults_for("embedded", only=("kil",), is_root=True)


def test_without_root_no_file_system_is_mounted() -> None:
    kinds = {kind.name for kind, _ in faults_for("embedded", is_root=False)}

    assert not kinds & {"full disk", "immutable"}


def test_every_kind_of_fault_can_be_made() -> None:
    assert set(FAULTS) == {kind.name for kind in KINDS}
