"""Migrations of a service form one line: two that follow the same one could not both be run."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = sorted(ROOT.glob("*/skyway_*/migrations/versions"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.parts[-3])
def test_migrations_form_one_line(folder: Path) -> None:
    follows: dict[str, str] = {}
    for file in sorted(folder.glob("0*.py")):
        text = file.read_text()
        revision = re.search(r'^revision = "(\d+)"', text, re.MULTILINE)
        before = re.search(r'^down_revision = (?:"(\d+)"|None)', text, re.MULTILINE)
        assert revision is not None, file
        assert before is not None, file
        assert file.name.startswith(revision[1]), f"{file.name} is revision {revision[1]}"
        assert (before[1] or "") not in follows, f"{file.name} follows the same one as another"
        follows[before[1] or ""] = revision[1]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.parts[-3])
def test_a_migration_that_others_follow_does_not_depend_on_the_code_of_today(folder: Path) -> None:
    *followed, _last = sorted(folder.glob("0*.py"))

    assert not [each.name for each in followed if "create_all" in each.read_text()]
