"""Statements as a page that prints well: no script, nothing from elsewhere."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import Final

from skyway.runtime.http.paging import Page
from skyway_gateway.ledger.statement import Statement

_STYLE: Final = """
body { font: 11pt/1.4 system-ui, sans-serif; max-width: 45rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; width: 100%; margin: 0 0 2rem; }
caption { text-align: left; font-weight: bold; padding: 0.3rem 0; }
th, td { padding: 0.2rem 0; border-bottom: 1px solid #bbb; text-align: left; font-weight: normal; }
td { text-align: right; font-variant-numeric: tabular-nums; }
tr:last-child > * { font-weight: bold; border-bottom: 2px solid; }
@page { margin: 2cm; }
@media print { body { margin: 0; max-width: none; } section { break-inside: avoid; } }
"""

#: The style above is the only thing that the page may use.
PAGE_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Vary": "Accept",
}


def statements_html(page: Page[Statement], month: str) -> str:
    """The statements of a page of the list, each with a table."""
    sections = "".join(_section(each) for each in page.items) or "<p>No lines in this month.</p>"
    more = "<p>There are more statements: ask for one party.</p>" if page.next_cursor else ""
    title = f"Statements {escape(month)}"
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style><h1>{title}</h1>{sections}{more}</html>"
    )


def _section(statement: Statement) -> str:
    caption = f"{statement.role.capitalize()} {statement.party_id}, {statement.currency}"
    state = "open: it may still change"
    if statement.closed_at is not None:
        state = f"closed on {statement.closed_at:%Y-%m-%d}"
    about = f"{statement.deliveries} deliveries, {statement.lines} lines, {state}"
    rows = "".join(_row(name, amount) for name, amount in _rows(statement))
    return (
        f"<section><table><caption>{escape(caption)}</caption>{rows}</table>"
        f"<p>{escape(about)}. Amounts in minor units of the currency.</p></section>"
    )


def _rows(statement: Statement) -> Iterator[tuple[str, int]]:
    amounts: Sequence[tuple[str, int]] = list(statement.items)
    yield from ((name.capitalize(), amount) for name, amount in amounts if amount != 0)
    yield "Total", statement.amount


def _row(name: str, amount: int) -> str:
    return f"<tr><th scope=row>{name}</th><td>{amount:,}</td></tr>"
