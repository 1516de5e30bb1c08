"""Ceilings for what a new developer must hold in the head: a delivery's way, and large rooms.

docs/decisions/0031-the-size-that-stays.md says why these. A change that makes one smaller lowers
its ceiling. A change that needs more says so in that page.
"""

import re
from pathlib import Path
from typing import Final

import pytest

from tools.house_figures import ROOT, source_files
from tools.trace_delivery import domain_files, own_calls, traced_calls

#: Lines of source without migrations, by folder.
MOST_LINES: Final = {"services/skyway_composition": 31_748, "skyway/runtime": 11_948}

#: Files of composition that import `MissionRecord`.
MOST_IMPORTERS: Final = 41

#: Files that a delivery passes, as `tools/trace_delivery.py` counts them: 206 to 214 on a quiet
#: machine and up to 221 on a busy one, where loops that run in the background were not all seen
#: before the delivery.
MOST_DOMAIN_FILES: Final = 228


@pytest.mark.parametrize("folder", MOST_LINES)
def test_a_large_room_has_no_more_lines_than_before(folder: str) -> None:
    lines = sum(
        len(path.read_text(encoding="utf-8").splitlines()) for path in source_files(ROOT / folder)
    )

    assert lines <= MOST_LINES[folder]


def test_no_more_files_than_before_depend_on_how_a_mission_is_stored() -> None:
    imports = re.compile(r"^from \S+ import \(?[^()]*\bMissionRecord\b", re.MULTILINE)
    files = source_files(ROOT / "services/skyway_composition")

    importers = [path for path in files if imports.search(path.read_text(encoding="utf-8"))]
    assert len(importers) <= MOST_IMPORTERS


@pytest.mark.end_to_end
@pytest.mark.long
def test_a_delivery_passes_no_more_files_than_before(tmp_path: Path) -> None:
    assert len(domain_files(own_calls(*traced_calls(tmp_path)))) <= MOST_DOMAIN_FILES
