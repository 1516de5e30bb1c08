"""Two agents never write the same journals."""

from pathlib import Path

import pytest
from skyway_drone_agent.journal_folder import FolderInUse, JournalFolder


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    with JournalFolder(tmp_path / "agent"), pytest.raises(FolderInUse):
        JournalFolder(tmp_path / "agent").__enter__()


def test_a_folder_is_free_again_afterwards(tmp_path: Path) -> None:
    for _ in range(2):
        with JournalFolder(tmp_path / "agent") as folder:
            assert folder.clock_file.parent.is_dir()
