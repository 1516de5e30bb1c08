"""The two versions of an upgrade: the code of this checkout, and that of an older commit."""

import io
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_HERE: Final = Path(__file__).parents[4]

#: The folders of a checkout that hold packages.
_PACKAGES_IN: Final = (".", "gateway", "services")


@dataclass(frozen=True, slots=True)
class Version:
    """The code of one version."""

    name: str
    source: Path

    @property
    def settings(self) -> dict[str, str]:
        """The environment in which a Python process runs this version."""
        return {"PYTHONPATH": os.pathsep.join(str(self.source / each) for each in _PACKAGES_IN)}


def this_version() -> Version:
    """The code of this checkout."""
    return Version("new", _HERE)


@contextmanager
def older_version(commit: str) -> Iterator[Version]:
    """The code of a commit in a folder of its own, with its planner compiled.

    It runs with the packages that are installed here, not with those that it names.
    """
    with tempfile.TemporaryDirectory(prefix="skyway-older-") as name:
        version = Version("old", Path(name))
        packed = subprocess.run(
            ["git", "archive", commit], cwd=_HERE, check=True, stdout=subprocess.PIPE
        )
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
            archive.extractall(version.source, filter="data")
        subprocess.run(
            [sys.executable, "-m", "skyway.planner.warm"],
            cwd=version.source,
            env={**os.environ, **version.settings},
            check=True,
        )
        yield version
