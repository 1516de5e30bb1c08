"""The house does not grow by accident: ceilings for files, folders and lines of the runtime.

docs/decisions/0031-the-size-that-stays.md says why the ceilings are where they are. A change that
makes something smaller lowers its ceiling. A change that needs more says so in a decision.
"""

from typing import Final

from tools.house_figures import ROOT, source_files, source_packages

#: Source files and folders with files, without migrations, as `tools/house_figures.py` counts them.
MOST_FILES: Final = 877
MOST_FOLDERS: Final = 85
#: Lines of `skyway/runtime`, which every process stands on.
MOST_RUNTIME_LINES: Final = 12_315


def test_there_are_no_more_files_and_folders_than_before() -> None:
    files = [path for package in source_packages() for path in source_files(package)]
    folders = {path.parent for path in files if path.name != "__init__.py"}

    assert len(files) <= MOST_FILES
    assert len(folders) <= MOST_FOLDERS


def test_the_runtime_has_no_more_lines_than_before() -> None:
    files = source_files(ROOT / "skyway/runtime")

    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
    assert lines <= MOST_RUNTIME_LINES
