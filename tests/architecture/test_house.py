"""The structure rules of CONTRIBUTING.md: short files and few floors."""

from pathlib import Path

import pytest

from tools.house_figures import (
    ROOT,
    Rooms,
    repeated_class_names,
    rooms_of,
    small_folders,
    source_files,
    source_packages,
)

PACKAGES = source_packages()


@pytest.mark.parametrize(
    "folder", ["services/skyway_composition/missions", "gateway/skyway_gateway/deliveries"]
)
def test_the_largest_folders_have_at_most_4_floors_and_20_arrows(folder: str) -> None:
    rooms = rooms_of(ROOT / folder)

    assert rooms.floors <= 4
    assert len(rooms.arrows) <= 20


def test_no_source_file_is_over_400_lines() -> None:
    too_long = {
        path.relative_to(ROOT).as_posix(): lines
        for package in PACKAGES
        for path in source_files(package)
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 400
    }

    assert not too_long


def test_the_figures_find_repeated_names_small_folders_and_arrows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.house_figures.SOURCES", (tmp_path,))
    sources = {
        "house/__init__.py": "from house import attic",
        "house/attic.py": "from house.cellar.wine import Bottle\nclass Box: ...",
        "house/cellar/__init__.py": "",
        "house/cellar/wine.py": "class Bottle: ...\nclass Box: ...",
    }
    for name, text in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    house = tmp_path / "house"

    assert repeated_class_names(house) == ["Box"]
    assert small_folders(house) == [house / "cellar"]
    assert rooms_of(house) == Rooms(2, 2, frozenset({("attic", "cellar")}))
