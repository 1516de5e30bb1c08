"""Files that only this user can read, and that are never half-written."""

import os
from pathlib import Path


def write_private(path: Path, content: str) -> None:
    """Write through a temporary file, so that no reader ever sees a half-written secret."""
    draft = path.with_name(f".{path.name}.draft")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(content)
    draft.replace(path)
