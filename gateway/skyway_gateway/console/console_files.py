"""The console's files, and the operator's own base map.

A file of the console is read once, compressed at the first request, and has a checksum.
"""

import base64
import gzip
import hashlib
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Final

from skyway.runtime.errors import NotFound

_MEDIA_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}
_IMPORT_MAP: Final = re.compile(rb'<script type="importmap">(.*?)</script>', re.DOTALL)


@dataclass(frozen=True)
class ConsoleFile:
    """A file as it is sent: its media type, its bytes with and without gzip, and its ETag."""

    media_type: str
    content: bytes
    etag: str

    @cached_property
    def compressed(self) -> bytes:
        """Compressed when first read: all files together would stop the event loop for long.

        A higher level takes four times as long for one per cent.
        """
        return gzip.compress(self.content, compresslevel=6, mtime=0)


@cache
def console_files() -> Mapping[str, ConsoleFile]:
    """All files by their path inside the console's folder, such as `views/map.js`.

    Nothing but these is served, so no path leads out of the folder.
    """
    folder = files("skyway_console") / "console"
    return MappingProxyType(
        {str(path): _read(path, file) for path, file in _inside(folder, PurePosixPath())}
    )


@cache
def import_map_hash() -> str:
    """The checksum of the page's import map, as a Content-Security-Policy names it."""
    found = _IMPORT_MAP.search(console_files()["index.html"].content)
    if found is None:
        raise LookupError("index.html of the console has no import map")
    return "sha256-" + base64.b64encode(hashlib.sha256(found.group(1)).digest()).decode()


def _inside(folder: Traversable, at: PurePosixPath) -> Iterator[tuple[PurePosixPath, Traversable]]:
    for each in folder.iterdir():
        if each.is_dir():
            yield from _inside(each, at / each.name)
        elif PurePosixPath(each.name).suffix in _MEDIA_TYPES:
            yield at / each.name, each


def _read(path: PurePosixPath, file: Traversable) -> ConsoleFile:
    content = file.read_bytes()
    checksum = hashlib.sha256(content).hexdigest()
    return ConsoleFile(_MEDIA_TYPES[path.suffix], content, f'"{checksum[:32]}"')


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
