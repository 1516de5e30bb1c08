"""Draws the files that a delivery passes, in order: a column for each service, a box for a room."""

from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby
from pathlib import PurePosixPath
from typing import Final

#: The columns, by the folder of their files, and their colours.
_COLUMNS: Final = {
    "gateway/skyway_gateway": ("gateway", "#2f6f9f"),
    "services/skyway_provider_registry": ("provider registry", "#7a5c9e"),
    "services/skyway_composition": ("composition", "#2e7d5b"),
    "services/skyway_drone_agent": ("drone agent", "#a8622d"),
    "skyway": ("library", "#666666"),
}

#: Sizes in pixels.
_WIDTH, _LINE, _MARGIN, _TOP = 250, 13, 8, 56


def drawn(files: Sequence[str]) -> str:
    """An SVG picture of these files; neighbours in one room share a box."""
    boxes, top_px = list[str](), _TOP
    for (column, room), group in groupby(files, key=_place):
        names = [PurePosixPath(file).name for file in group]
        boxes += _box(column, room, names, top_px=top_px)
        top_px += _LINE * (1 + len(names)) + _MARGIN
    width_px = _WIDTH * len(_COLUMNS)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {top_px}"',
            'font-family="sans-serif" font-size="10">',
            f'<rect width="{width_px}" height="{top_px}" fill="#ffffff"/>',
            *_head(len(files), top_px),
            *boxes,
            "</svg>",
            "",
        ]
    )


def _place(file: str) -> tuple[str, str]:
    """The column of a file, and its folder inside."""
    column = next(each for each in _COLUMNS if file.startswith(f"{each}/"))
    room = PurePosixPath(file).parent.relative_to(column).as_posix()
    return column, "" if room == "." else room


def _head(count: int, bottom_px: int) -> Iterable[str]:
    yield (
        f'<text x="{_MARGIN}" y="18" font-size="14" font-weight="bold">The way of a delivery: '
        f"{count} files, from above to below in the order of their first calls</text>"
    )
    for number, (title, colour) in enumerate(_COLUMNS.values()):
        left_px = number * _WIDTH
        yield (
            f'<text x="{left_px + _MARGIN}" y="42" font-size="13" font-weight="bold" '
            f'fill="{colour}">{title}</text>'
        )
        yield f'<path d="M{left_px} 28V{bottom_px}" stroke="#dddddd"/>'


def _box(column: str, room: str, names: Sequence[str], *, top_px: int) -> Iterable[str]:
    _, colour = _COLUMNS[column]
    left_px = [*_COLUMNS].index(column) * _WIDTH + _MARGIN
    height_px = _LINE * (1 + len(names)) + _MARGIN // 2
    yield (
        f'<rect x="{left_px}" y="{top_px}" width="{_WIDTH - 2 * _MARGIN}" height="{height_px}" '
        f'rx="3" fill="{colour}" fill-opacity="0.08" stroke="{colour}"/>'
    )
    for number, text in enumerate([f"{room}/" if room else f"{column}/", *names]):
        weight = ' font-weight="bold"' if number == 0 else ""
        yield (
            f'<text x="{left_px + 6}" y="{top_px + _LINE * (number + 1) - 2}" '
            f'fill="{colour if number == 0 else "#222222"}"{weight}>{escape(text)}</text>'
        )
