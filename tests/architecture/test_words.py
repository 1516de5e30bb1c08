"""Names and sentences use plain words: docs/glossary.md lists the banned ones, this checks them."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]
SOURCES: Final = ("skyway", "gateway", "services", "tests", "lab", "examples", "tools")
#: The page that lists the banned words itself.
GLOSSARY: Final = ROOT / "docs/glossary.md"

#: Names that stay: the OpenAPI documents show these arguments as titles of bodies.
PUBLIC_NAMES: Final = {
    "gateway/skyway_gateway/deliveries/requests/routes.py": "wanted",
    "services/skyway_provider_registry/fleets/routes.py": "wanted",
}

#: Words that mean something else together: a drone takes off, a gateway takes over, in turns.
_PHRASES: Final = re.compile(r"\btake (offs?|over|turns)\b")
_WORDS_OF_A_NAME: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_FUNCTIONS: Final = (ast.FunctionDef, ast.AsyncFunctionDef)


@cache
def words_banned_in(kind: str) -> tuple[str, ...]:
    """The words of a table of the glossary; its first heading is `banned in <kind>`."""
    table = (
        GLOSSARY.read_text(encoding="utf-8")
        .partition(f"| banned in {kind} |")[2]
        .partition("\n\n")[0]
    )
    first_cells = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    return tuple(word for cell in first_cells for word in re.findall("`([^`]+)`", cell))


@cache
def banned(kind: str) -> re.Pattern[str]:
    """Finds a banned word in small letters."""
    return re.compile(rf"\b({'|'.join(words_banned_in(kind))})\b")


@cache
def suspect(kind: str) -> re.Pattern[str]:
    """Finds each banned word anywhere in a source, and some harmless ones; fast."""
    words = words_banned_in(kind)
    forms = {form for word in words for form in (word, word.capitalize(), word.upper())}
    alternatives = "|".join(sorted(form.replace(" ", r"[\s_#]+") for form in forms))
    return re.compile(rf"(?:(?<![a-z])|(?=[A-Z]))(?:{alternatives})(?![a-z])")


def spoken(name: str) -> str:
    """The words of a name in snake_case or CamelCase, as a sentence in small letters."""
    return " ".join(_WORDS_OF_A_NAME.findall(name)).lower()


def is_banned(name: str) -> bool:
    """Whether a name has a banned word."""
    return bool(banned("names").search(_PHRASES.sub("", spoken(name))))


def names_of(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Every name that a source defines, with its line; tests are sentences and left out."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.ClassDef, *_FUNCTIONS)) and not node.name.startswith("test_"):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


def sentences_of(tree: ast.AST, source: str) -> Iterator[tuple[str, int]]:
    """Every docstring, comment and name of a test, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, *_FUNCTIONS)):
            if text := ast.get_docstring(node):
                yield " ".join(text.split()), node.body[0].lineno
            if isinstance(node, _FUNCTIONS) and node.name.startswith("test_"):
                yield spoken(node.name), node.lineno
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string, token.start[0]


def texts_of(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Every string of several words, with its line: people may read it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield " ".join(node.value.split()), node.lineno


def findings(source: str, place: str) -> Iterator[str]:
    """The banned words of one source and of its file's name."""
    stem = Path(place).stem
    if is_banned(stem.removeprefix("test_")) or banned("sentences").search(spoken(stem)):
        yield f"{place}: the name of the file"
    may_name, may_say = (suspect(kind).search(source) for kind in ("names", "sentences"))
    if may_name or may_say:
        tree = ast.parse(source)
    if may_name:
        for name, line in names_of(tree):
            if is_banned(name) and PUBLIC_NAMES.get(place) != name:
                yield f"{place}:{line}: the name {name}"
    if may_say:
        said = dict.fromkeys(sentences_of(tree, source))
        if not place.startswith("tests/"):  # these have SQL with older names of columns
            said |= dict.fromkeys(texts_of(tree))
        for sentence, line in said:
            if found := banned("sentences").search(sentence.lower()):
                yield f"{place}:{line}: {found.group()!r} in {sentence[:60]!r}"


def test_no_source_has_a_banned_word() -> None:
    found = [
        finding
        for top in SOURCES
        for path in sorted((ROOT / top).rglob("*.py"))
        if path != Path(__file__)  # its examples have banned words
        for finding in findings(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())
    ]

    assert not found


def prose(page: str) -> str:
    """A page without blocks of code, names in code, and quotations."""
    return re.sub(r"```.*?```|`[^`\n]*`|\"[^\"\n]*\"", "", page, flags=re.DOTALL)


def test_no_page_has_a_banned_word() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]

    found = {
        path.relative_to(ROOT).as_posix(): words
        for path in pages
        if path != GLOSSARY
        and (
            words := banned("sentences").findall(
                " ".join(prose(path.read_text(encoding="utf-8")).lower().split())
            )
        )
    }

    assert not found


@pytest.mark.parametrize(
    "source",
    [
        "told = 1",
        "class WantedOffer: ...",
        "def take_offer(): ...",
        "def read(somebody): ...",
        "drone.last_heard_at = None",
        '"""The reader is told."""',
        'def stop():\n    """Stops all of them at\n    once."""',
        "x = 1  # Whatever it is.",
        'x = "the drone is told"',
        "def test_the_customer_hears_it(): ...",
    ],
)
def test_a_banned_word_is_found(source: str) -> None:
    assert len(list(findings(source, "a.py"))) == 1


@pytest.mark.parametrize(
    "source",
    ["take_off_at = 1", "hearing = 1", "def test_a_flight_takes_an_hour(): ...", "retold = 1"],
)
def test_other_words_are_not_found(source: str) -> None:
    assert not list(findings(source, "a.py"))


@pytest.mark.parametrize("place", ["cli/patience.py", "test_the_drone_is_told.py"])
def test_a_banned_word_in_the_name_of_a_file_is_found(place: str) -> None:
    assert len(list(findings("x = 1", place))) == 1


def test_both_tables_of_the_glossary_are_read() -> None:
    assert "take" in words_banned_in("names")
    assert "at once" in words_banned_in("sentences")
