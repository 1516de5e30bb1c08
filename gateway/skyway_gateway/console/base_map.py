"""The operator's own base map: a folder with a MapLibre style and what the style names."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from skyway.runtime.errors import NotFound

#: The file that the console asks for first; others are named in it.
STYLE = "style.json"


@dataclass(frozen=True, slots=True)
class BaseMap:
    """Files below a folder; without a folder there are none, and the console draws outlines."""

    folder: Path | None

    def file_at(self, path: str) -> Path:
        """The file at this path inside the folder, also through links that stay in it.

        Raises
        ------
        NotFound
            There is no such file in the folder, or no folder.
        """
        if self.folder is not None and "\0" not in path:
            folder = self.folder.resolve()
            # A path may be longer than the file system allows.
            with suppress(OSError):
                file = (folder / path).resolve()
                if file.is_relative_to(folder) and file.is_file():
                    return file
        raise NotFound("file of the base map", path)
