"""One supervisor per data folder."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager

from skyway.cli.data_folder import DataFolder
from skyway.errors import SkywayError


@contextmanager
def held(folder: DataFolder) -> Iterator[None]:
    """Hold the folder; the kernel lets go of it when this process ends, however it ends.

    Raises
    ------
    SkywayError
        Another process holds it.
    """
    with folder.lock_file.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SkywayError(f"another Skyway runs on {folder.path}; stop it first") from error
        yield
