"""What is wrong with a field, in Skyway's words instead of those of pydantic and Python."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from itertools import islice
from typing import Any, Final, get_args

from pydantic_core.core_schema import ErrorType

from skyway.bounds import NO_MOMENT

#: The kind of our own complaint about a body that is not JSON.
BROKEN_JSON: Final = "broken_json"

#: Each sentence, and the kinds of pydantic's errors for which it stands.
_SENTENCES: Final = {
    "is missing": "missing missing_argument missing_keyword_only_argument",
    "is not a known field": "extra_forbidden unexpected_keyword_argument",
    "must be null": "none_required",
    "must be above {gt}": "greater_than",
    "must be at least {ge}": "greater_than_equal",
    "must be below {lt}": "less_than",
    "must be at most {le}": "less_than_equal",
    "must be a multiple of {multiple_of}": "multiple_of",
    "must be a finite number": "finite_number",
    "must be a whole number": "int_type int_parsing int_from_float",
    "is too long for a whole number": "int_parsing_size",
    "must be a number": "float_type float_parsing decimal_type decimal_parsing",
    "must be true or false": "bool_type bool_parsing",
    "must be text": "string_type bytes_type url_type uuid_type",
    "must be text in UTF-8": "string_unicode bytes_invalid_encoding",
    "must be text of ASCII characters": "string_not_ascii",
    "must have at least {min_length} characters": "string_too_short bytes_too_short",
    "must have at most {max_length} characters": "string_too_long bytes_too_long url_too_long",
    "must match the pattern {pattern}": "string_pattern_mismatch",
    "must have at least {min_length} items; it has {actual_length}": "too_short",
    "must have at most {max_length} items; it has more": "too_long",
    "must be a list": "list_type tuple_type set_type frozen_set_type iterable_type",
    "has more items than are known": "unexpected_positional_argument",
    "must be an object": (
        "arguments_type dataclass_type dict_type mapping_type model_attributes_type "
        "model_type named_tuple_type"
    ),
    "must be {expected}": "literal_error enum",
    "has an unknown {discriminator}; known are {expected_tags}": "union_tag_invalid",
    "must have a known {discriminator}": "union_tag_not_found",
    "must be a date like 2026-03-02": "date_type date_parsing date_from_datetime_parsing",
    "must be a time like 09:16": "time_type time_parsing",
    NO_MOMENT: (
        "datetime_from_date_parsing datetime_object_invalid datetime_parsing datetime_type "
        "timezone_aware"
    ),
    "must be a URL": "url_parsing url_syntax_violation",
    "must be a URL that begins with {expected_schemes}": "url_scheme",
    "{error}": "assertion_error value_error",
}
_BY_KIND: Final = {
    kind: sentence for sentence, kinds in _SENTENCES.items() for kind in kinds.split()
}
#: The most known names that are looked at, and the most that are compared letter by letter.
_MOST_KNOWN: Final = 20_000
_MOST_COMPARED: Final = 200
#: What users need not know as a pattern.
_PATTERNS: Final = {
    "^[A-Za-z0-9_-]+$": "may have only letters, digits, - and _",
    "^[A-Z]{3}$": "must be three capital letters, such as USD",
    "^[+][1-9][0-9]{6,14}$": "must be a phone number in E.164 form, such as +15125550100",
    "^[^@\\s]+@[^@\\s]+[.][^@\\s]+$": "must be an e-mail address, such as ana@example.org",
}
_FOREIGN: Final = frozenset(get_args(ErrorType))


# A complaint is one of pydantic's error dicts, which have no public type.
def sentence_of(complaint: Mapping[str, Any]) -> str:
    """What is wrong, with the limit. Our own kinds of errors bring their sentence with them."""
    kind, context = complaint["type"], complaint.get("ctx", {})
    if kind == "string_type" and type(complaint.get("input")) is int:
        return f'must be text, such as "{str(complaint["input"])[:20]}"'
    if (words := _PATTERNS.get(context.get("pattern", ""))) is not None:
        return words
    sentence = _BY_KIND.get(kind, "is not valid" if kind in _FOREIGN else complaint["msg"])
    limits = {
        name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in context.items()
    }
    return sentence.format_map(limits) if kind in _BY_KIND else sentence


def fault_of(complaint: Mapping[str, Any], *above: str) -> tuple[str, str]:
    """The path of the field at fault below the fields `above`, and what is wrong with it."""
    return ".".join(map(str, (*above, *complaint["loc"]))), sentence_of(complaint)


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """That nothing of this kind has the name, and which known name is near.

    Only some of many known names are compared, so that a wrong name costs little.
    """
    ends = name[:2].lower(), name[-2:].lower()
    similar = (
        each
        for each in islice(known, _MOST_KNOWN)
        if ends[0] == each[:2].lower() or ends[1] == each[-2:].lower()
    )
    nearest = get_close_matches(name, islice(similar, _MOST_COMPARED), n=1)
    return f"no {kind} is called {name!r}" + "".join(
        f"; did you mean {near!r}?" for near in nearest
    )
