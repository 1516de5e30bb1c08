"""What CONTRIBUTING.md asks of files, checked for all of them."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
VAGUE = re.compile(r"(^|/)(utils?|helpers?|common|misc|managers?|base|shared)(/|\.py$)")
SERVICES = ("skyway_gateway", "skyway_provider_registry", "skyway_composition")


def tracked(pattern: str) -> list[Path]:
    """Files that git tracks or would track, so that a stray build folder does not count."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", pattern],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return [ROOT / name for name in listed.stdout.splitlines() if (ROOT / name).exists()]


def test_no_python_file_is_over_450_lines() -> None:
    """A test file has all tests of one page or source file; test_house.py allows sources 400.

    The first migration of a service has all its tables, and is read beside `tables.py` only.
    """
    too_long = {
        path.relative_to(ROOT): lines
        for path in tracked("*.py")
        if "migrations" not in path.parts and (lines := len(path.read_text().splitlines())) > 450
    }

    assert not too_long


def test_no_file_has_a_name_that_says_nothing() -> None:
    vague = [path for path in tracked("*.py") if VAGUE.search(str(path.relative_to(ROOT)))]

    assert not vague


@pytest.mark.parametrize("word", ["TODO", "FIXME", "NotImplemented" + "Error"])
def test_nothing_is_left_to_do_in_the_code(word: str) -> None:
    mine = Path(__file__)
    found = [p for p in tracked("*.py") if p != mine and re.search(rf"\b{word}\b", p.read_text())]

    assert not found


@pytest.mark.parametrize("lock", ["", "-run", "-uv", "-image", "-peers"])
def test_the_lock_names_no_address_and_every_hash(lock: str) -> None:
    lines = (ROOT / f"requirements{lock}.txt").read_text().splitlines()
    pins = [line for line in lines if re.match(r"^[a-z0-9]", line)]

    assert not [line for line in lines if "://" in line]
    assert all(line.rstrip().endswith("\\") for line in pins)
    assert not (ROOT / "uv.lock").exists()
