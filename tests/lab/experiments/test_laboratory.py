import pytest
from skyway_lab.experiments.laboratory import Laboratory, open_laboratory


def square(number: int) -> int:
    """Something that a worker process can import."""
    return number * number


def test_results_have_the_order_of_their_trials(laboratory):
    assert laboratory.results("squares", square, [3, 1, 2]) == [9, 1, 4]


@pytest.mark.long
def test_a_laboratory_with_workers_gives_the_same_results(tmp_path):
    with open_laboratory(seed=1, is_quick=True, folder=tmp_path / "new") as laboratory:
        results = laboratory.results("absolutes", abs, [-3, 1, -2])

    assert results == [3, 1, 2]
    assert (tmp_path / "new").is_dir()


def test_seeds_of_instances_come_from_the_run_s_seed(laboratory):
    other = Laboratory(2, is_quick=True, folder=laboratory.folder, progress=laboratory.progress)

    assert laboratory.seed_for("paper", 10, 0) == laboratory.seed_for("paper", 10, 0)
    assert laboratory.seed_for("paper", 10, 0) != laboratory.seed_for("paper", 10, 1)
    assert laboratory.seed_for("paper", 10, 0) != other.seed_for("paper", 10, 0)
