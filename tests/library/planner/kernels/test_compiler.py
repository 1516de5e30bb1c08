"""Compiled kernels are kept until a source of any kernel changes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba.core import config

import skyway.planner.kernels
from skyway.planner.kernels import compiler, search, trees
from skyway.planner.warm import warm


def test_the_stamp_changes_with_any_source(tmp_path: Path) -> None:
    package = tmp_path / "kernels"
    (source,) = skyway.planner.kernels.__path__
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))

    before, again, changed = _stamps(tmp_path, change=package / "charging.py")

    assert before == again
    assert changed != before


def test_every_entry_point_is_compiled_for_one_signature() -> None:
    warm()

    entrances: list[Any] = [search.begin, search.run, trees.plant_all]
    assert [len(each.signatures) for each in entrances] == [1] * 3


@pytest.mark.long
def test_only_what_python_calls_is_kept_and_a_wait_for_the_compiler_is_explained(
    tmp_path: Path,
) -> None:
    code = """
import numpy as np
from skyway.planner.kernels.bounds import fill_floors
fill_floors(np.zeros((4, 2)), np.zeros(2), np.zeros(5))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", code]

    first, second = (
        subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
        for _ in range(2)
    )

    assert first.stderr.count("The planner is compiled, once") == 1
    assert second.stderr == ""
    assert {path.name.partition("-")[0] for path in tmp_path.rglob("*.nbi")} == {
        "bounds.fill_floors"
    }


@pytest.mark.parametrize(
    ("lacking", "chosen", "expected"),
    [
        (None, "x86-64-v3", ("x86-64-v3", "")),
        ("avx2", "x86-64-v3", (None, None)),
        ("movbe", "x86-64-v3", (None, None)),
        ("avx2", "znver3", ("znver3", "")),
        ("avx2", None, (None, "")),
    ],
)
def test_a_processor_that_cannot_run_the_code_of_the_image_gets_its_own(
    monkeypatch: pytest.MonkeyPatch,
    lacking: str | None,
    chosen: str | None,
    expected: tuple[str | None, str | None],
) -> None:
    abilities = {each: each != lacking for each in compiler._ABILITIES}
    monkeypatch.setattr(compiler, "get_host_cpu_features", lambda: abilities)
    monkeypatch.setattr(config, "CPU_NAME", chosen)
    monkeypatch.setattr(config, "CPU_FEATURES", "")

    compiler._compile_for_this_processor_if_it_can_do_less()

    left = (config.CPU_NAME, config.CPU_FEATURES)
    assert left == expected


def test_kernels_without_a_folder_that_can_be_written_to_are_refused_with_the_setting(
    tmp_path: Path,
) -> None:
    package = tmp_path / "kernels"
    (source,) = skyway.planner.kernels.__path__
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__pycache__").touch()  # a file: not even root can write below it
    code = "from kernels import ways"
    environment = {**os.environ, "XDG_CACHE_HOME": str(package / "__pycache__")}
    environment.pop("NUMBA_CACHE_DIR", None)

    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )

    assert "set NUMBA_CACHE_DIR to one" in done.stderr


def _stamps(folder: Path, *, change: Path) -> list[str]:
    """The stamps of a folder's kernels: twice before a source is changed, and once afterwards."""
    code = f"""
from pathlib import Path
from kernels.compiler import _digest_of_sources

for text in ("", "", "\\n"):
    with Path({str(change)!r}).open("a") as source:
        source.write(text)
    print(_digest_of_sources().hex())
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=True, text=True)
    return done.stdout.split()
