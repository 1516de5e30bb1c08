"""Every page that the repository names is in the repository, and every link in a page works."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: A page named in code, a comment, a setting or a document, with its anchor if it has one.
PAGE = re.compile(r"(?<![\w./*{}<-])([\w./-]*\w\.md)(?:#([\w-]+))?\b")
#: A source file named with its folder in code, a comment or a document, between backquotes.
SOURCE = re.compile(r"`([\w-]+(?:/[\w-]+)+\.py)(?=[`: ])")
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
IMAGE = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)")
#: Pages that programs write into a folder of the user's choice.
WRITTEN_BY_PROGRAMS = frozenset({"postgresql.md"})


def tracked_files() -> list[Path]:
    """The files of the project: tracked by git, or new and not ignored."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return sorted(Path(name) for name in listed.stdout.splitlines() if (ROOT / name).is_file())


FILES = tracked_files()
PAGES = [path for path in FILES if path.suffix == ".md"]
SOURCES = [f"/{path.as_posix()}" for path in FILES if path.suffix == ".py"]
#: Decisions name files that later decisions have removed.
HISTORY = Path("docs/decisions")


def text_of(path: Path) -> str:
    try:
        return (ROOT / path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def pages_named(name: str) -> list[Path]:
    """The pages of this name: a path from the root, or the end of a path."""
    return [page for page in PAGES if f"/{page.as_posix()}".endswith(f"/{name}")]


def anchors_of(page: Path) -> set[str]:
    """The anchors of a page's headings, made as GitHub makes them."""
    seen: dict[str, int] = {}
    anchors = set()
    in_code = False
    for line in text_of(page).splitlines():
        if line.startswith("```"):
            in_code = not in_code
        heading = None if in_code else re.match(r"#{1,6} +(.+?)\s*#*$", line)
        if heading is None:
            continue
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        count = seen.get(slug, 0)
        seen[slug] = count + 1
        anchors.add(f"{slug}-{count}" if count else slug)
    return anchors


def broken_citations(path: Path) -> Iterator[str]:
    for name, anchor in PAGE.findall(text_of(path)):
        if name in WRITTEN_BY_PROGRAMS:
            continue
        pages = pages_named(name.lstrip("./"))
        if not pages:
            yield name
        elif anchor and all(anchor not in anchors_of(page) for page in pages):
            yield f"{name}#{anchor}"


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL)


def link_works(page: Path, target: str) -> bool:
    name, _, anchor = target.partition("#")
    linked = (ROOT / page.parent / name).resolve() if name else ROOT / page
    if not linked.is_relative_to(ROOT) or not linked.exists():
        return False
    return not anchor or anchor in anchors_of(linked.relative_to(ROOT))


def broken_links(page: Path) -> Iterator[str]:
    for target in LINK.findall(prose(page)) + IMAGE.findall(prose(page)):
        if not re.match(r"[a-z]+:", target) and not link_works(page, target):
            yield target


def test_every_page_that_a_file_names_is_in_the_repository() -> None:
    broken = {
        str(path): names
        for path in FILES
        if path != Path(__file__).relative_to(ROOT) and (names := sorted(broken_citations(path)))
    }

    assert not broken


def test_every_source_file_that_a_file_names_is_in_the_repository() -> None:
    broken = {
        str(path): names
        for path in FILES
        if not path.is_relative_to(HISTORY)
        and (
            names := [
                name
                for name in SOURCE.findall(text_of(path))
                if not any(source.endswith(f"/{name}") for source in SOURCES)
            ]
        )
    }

    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_relative_link_and_anchor_of_a_page_works(page: Path) -> None:
    assert not list(broken_links(page))


def test_every_reference_page_is_in_both_tables() -> None:
    pages = {p.name for p in PAGES if p.parent == Path("docs/reference")} - {"README.md"}

    index = set(LINK.findall(text_of(Path("docs/reference/README.md"))))
    readme = set(LINK.findall(text_of(Path("README.md"))))

    assert pages == {name for name in index if "/" not in name and name.endswith(".md")}
    assert {f"docs/reference/{name}" for name in pages} <= readme


def test_a_page_that_does_not_exist_is_noticed() -> None:
    assert pages_named("docs/reference/rest.md")
    assert pages_named("rest.md")
    assert not pages_named("no-such-page.md")
    assert "versions-and-etag" not in anchors_of(Path("README.md"))
