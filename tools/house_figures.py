"""Print how large the house is: files, folders, and the rooms, floors and arrows of a folder.

python tools/house_figures.py                      figures of all source packages
python tools/house_figures.py FOLDER [FOLDER ...]  rooms, floors and arrows of these folders

A room is a file or a folder directly inside FOLDER. An arrow is an import from one room to
another. Floors are the longest chain of rooms that import each other.
"""

import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent

#: The folders that hold the source packages, as Python finds them.
SOURCES: Final = (ROOT, ROOT / "gateway", ROOT / "services")


@dataclass(frozen=True, slots=True)
class Rooms:
    """The rooms of one folder: how many, how many floors high, and which arrows join them."""

    count: int
    floors: int
    arrows: frozenset[tuple[str, str]]


def source_packages() -> list[Path]:
    """The folders of `skyway`, the gateway and the services."""
    return sorted(path.parent for base in SOURCES for path in base.glob("skyway*/__init__.py"))


def source_files(folder: Path) -> list[Path]:
    """The Python files below a folder, without migrations."""
    return sorted(path for path in folder.rglob("*.py") if "migrations" not in path.parts)


def module_name(path: Path) -> str:
    """The dotted name under which Python imports a file."""
    base = next(base for base in reversed(SOURCES) if path.is_relative_to(base))
    parts = path.relative_to(base).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(path: Path) -> Iterator[str]:
    """The dotted names that a file imports; of `from a import b` both `a` and `a.b`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def rooms_of(folder: Path) -> Rooms:
    """The rooms, floors and arrows of a folder."""
    prefix = module_name(folder / "__init__.py") + "."
    files = [path for path in source_files(folder) if path != folder / "__init__.py"]
    rooms = {path.relative_to(folder).parts[0].removesuffix(".py") for path in files}
    arrows = set()
    for path in files:
        room = path.relative_to(folder).parts[0].removesuffix(".py")
        targets = {
            name.removeprefix(prefix).partition(".")[0]
            for name in imported_modules(path)
            if name.startswith(prefix)
        }
        arrows |= {(room, target) for target in targets & rooms - {room}}
    return Rooms(len(rooms), _longest_chain(rooms, arrows), frozenset(arrows))


def _longest_chain(rooms: set[str], arrows: set[tuple[str, str]]) -> int:
    below = defaultdict(set)
    for room, target in arrows:
        below[room].add(target)

    @cache
    def height(room: str, path: frozenset[str] = frozenset()) -> int:
        targets = below[room] - path
        return 1 + max((height(each, path | {room}) for each in targets), default=0)

    return max((height(room) for room in rooms), default=0)


def small_folders(package: Path) -> list[Path]:
    """The folders inside a package with fewer than three files; a folder counts as a file."""
    files = source_files(package)
    folders = {path.parent for path in files}
    entries = Counter(path.parent for path in files if path.name != "__init__.py")
    entries.update(folder.parent for folder in folders)
    return sorted(folder for folder in folders - {package} if entries[folder] < 3)


def repeated_class_names(package: Path) -> list[str]:
    """The class names that a package defines more than once."""
    names = Counter(
        node.name
        for path in source_files(package)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    return sorted(name for name, count in names.items() if count > 1)


def main(folders: list[str]) -> int:
    """Print the figures."""
    for folder in folders:
        rooms = rooms_of((ROOT / folder).resolve())
        print(f"{folder}: {rooms.count} rooms, {rooms.floors} floors, {len(rooms.arrows)} arrows")
        for room, target in sorted(rooms.arrows):
            print(f"  {room} -> {target}")
    if folders:
        return 0
    total_files, total_folders = 0, 0
    for package in source_packages():
        files = source_files(package)
        in_folder = Counter(path.parent for path in files if path.name != "__init__.py")
        total_files += len(files)
        total_folders += len(in_folder)
        lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
        print(
            f"{package.name}: {len(files)} files, {len(in_folder)} folders, {lines} lines, "
            f"{sum(path.name == 'store.py' for path in files)} files called store.py"
        )
        for small in small_folders(package):
            print(f"  fewer than three files: {small.relative_to(ROOT)}")
        for name in repeated_class_names(package):
            print(f"  class name used twice: {name}")
    print(f"all: {total_files} files, {total_folders} folders")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
