"""Files that only their owner can read, and that are never half-written."""

import os
from pathlib import Path


def write_private(path: Path, content: str) -> None:
    """Write through a temporary file, so that no reader ever sees a half-written secret.

    A file that root writes belongs to the owner of its folder.
    """
    draft = path.with_name(f".{path.name}.draft")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w") as file:
        give_to_owner_of(path.parent, descriptor)
        file.write(content)
    draft.replace(path)


def give_to_owner_of(folder: Path, descriptor: int) -> None:
    """Give a file that root has open to the owner of a folder."""
    if os.geteuid() == 0:
        owner = folder.stat()
        os.fchown(descriptor, owner.st_uid, owner.st_gid)
