"""Lists as CSV (RFC 4180): each list of the API answers `Accept: text/csv`.

A row is an item. The columns come from the schema of the items, so that they are the same for each
page: a member of an object has a column of its own, as `price.amount`. A cell with a list holds its
JSON. The next page is in the header `Link`.
"""

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, get_args

from fastapi import Request, Response

from skyway.json_model import JsonModel

CSV: Final = "text/csv"

#: The form that the answers have.
CSV_FORM: Final = "text/csv; charset=utf-8; header=present"

#: The parameters that a caller may name with `text/csv`: others would ask for another form.
_PARAMETERS: Final = re.compile(r"charset=\"?utf-8\"?|header=present|q=[0-9.]+")

_WEIGHT: Final = re.compile(r"q=([01](?:\.[0-9]{0,3})?)")

#: Spreadsheets take a cell that begins so for a formula, also after blanks.
_FORMULA: Final = re.compile(r"\s*[=+\-@\uff1d\uff0b\uff0d\uff20]|[\t\r\n]")

#: How the types end in which lists are answered.
_OF_LISTS: Final = ("json", "html", "csv")

_REFERENCE: Final = "#/components/schemas/"
#: Objects in objects have columns up to this depth; deeper ones are JSON in a cell.
_DEPTH: Final = 4

#: The names of the members that lead to a value.
Column = tuple[str, ...]

Json = Mapping[str, Any]  # a JSON object


def item_models(answer: object) -> tuple[type[JsonModel], ...]:
    """The models of the items of a list, which is an answer with `items`; none for others."""
    if isinstance(answer, type) and issubclass(answer, JsonModel):
        items = answer.model_fields.get("items")
        return () if items is None else get_args(items.annotation)[:1]
    return tuple(model for each in get_args(answer) for model in item_models(each))


def columns_of_models(models: Sequence[type[JsonModel]]) -> tuple[Column, ...]:
    """The columns of a list whose items have one of these models."""
    found: dict[Column, None] = {}
    for model in models:
        schema = model.model_json_schema(mode="serialization", ref_template=_REFERENCE + "{model}")
        found |= dict.fromkeys(columns_of(schema, schema.get("$defs", {})))
    return tuple(found)


def columns_of(schema: Json, schemas: Mapping[str, Json]) -> Iterator[Column]:
    """The columns of items with this JSON schema; `schemas` has those that it names."""
    return _columns(schema, schemas, ())


def _columns(schema: Json, schemas: Mapping[str, Json], path: Column) -> Iterator[Column]:
    schema = _resolved(schema, schemas)
    members = schema.get("properties")
    if not members or len(path) == _DEPTH:
        yield path
        return
    for name, member in members.items():
        yield from _columns(member, schemas, (*path, name))


def _resolved(schema: Json, schemas: Mapping[str, Json]) -> Json:
    """The schema that a reference names, or that stands beside null."""
    options = [each for each in schema.get("anyOf", ()) if each.get("type") != "null"]
    if len(options) == 1:
        return _resolved(options[0], schemas)
    name = str(schema.get("$ref", "")).removeprefix(_REFERENCE)
    return _resolved(schemas[name], schemas) if name else schema


def prefers(media_type: str, request: Request) -> bool:
    """Whether the caller names this type, and no other type of lists with a higher weight."""
    accept = ", ".join(request.headers.getlist("accept")).lower()
    if media_type not in accept:
        return False
    weights: dict[str, float] = {}
    for part in accept.split(","):
        media, *parameters = (each.strip() for each in part.split(";"))
        if media != CSV or is_known_form(parameters):
            weights[media] = _weight(parameters)
    own = weights.pop(media_type, 0.0)
    others = (weight for media, weight in weights.items() if media.endswith(_OF_LISTS))
    return own > 0 and own >= max(others, default=0.0)


def is_known_form(parameters: Sequence[str]) -> bool:
    """Whether the form of CSV that a caller names is the one that Skyway writes."""
    return all(_PARAMETERS.fullmatch(each) for each in parameters)


def _weight(parameters: Sequence[str]) -> float:
    found = map(_WEIGHT.fullmatch, parameters)
    return next((float(each[1]) for each in found if each is not None), 1.0)


def csv_answer(page: Json, columns: Sequence[Column], request: Request) -> Response:
    """A page of a list as CSV; its first row has the names of the columns."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(".".join(column) for column in columns)
    for item in page["items"]:
        writer.writerow(_cell(item, column) for column in columns)
    headers = {"Vary": "Accept"}
    if (cursor := page.get("next_cursor")) is not None:
        following = request.url.include_query_params(cursor=cursor)
        headers["Link"] = f'<{following.path}?{following.query}>; rel="next"'
    return Response(text.getvalue().encode(), media_type=CSV_FORM, headers=headers)


def _cell(item: Any, column: Column) -> object:  # any JSON value
    for name in column:
        item = item.get(name) if isinstance(item, dict) else None
    if isinstance(item, str):
        # A quote makes a text of what a spreadsheet would compute.
        return f"'{item}" if _FORMULA.match(item) else item
    if isinstance(item, bool | list | dict):
        return json.dumps(item, ensure_ascii=False)
    return item
