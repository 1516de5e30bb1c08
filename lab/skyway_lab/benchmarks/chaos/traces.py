"""The folder of a run, and what of it is kept for people to look at."""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from skyway.cli.data_folder import DataFolder


@contextmanager
def run_folder() -> Iterator[DataFolder]:
    """A temporary data folder; of a run that fails the traces are kept."""
    with tempfile.TemporaryDirectory(prefix="skyway-chaos-") as name:
        folder = DataFolder(Path(name))
        folder.make()
        try:
            yield folder
        except Exception:
            keep_traces(folder)
            raise


def keep_traces(folder: DataFolder) -> Path:
    """Copy logs, journals and SQLite databases to a folder that stays; returns it."""
    kept = Path(tempfile.mkdtemp(prefix="skyway-chaos-traces-"))
    for part in (folder.logs, folder.journals):
        shutil.copytree(part, kept / part.name, ignore=shutil.ignore_patterns("*.lock"))
    for database in folder.path.glob("*.db"):
        for file in database.resolve().parent.glob(f"{database.name}*"):
            shutil.copy(file, kept)
    print(f"logs, journals and databases are in {kept}", file=sys.stderr, flush=True)
    return kept


def keep_databases(kept: Path, urls: Mapping[str, str]) -> None:
    """Dump the services' PostgreSQL databases as SQL."""
    for service, url in urls.items():
        command = ["pg_dump", "--inserts", f"--dbname={url}", f"--file={kept / service}.sql"]
        subprocess.run(command, check=False)
