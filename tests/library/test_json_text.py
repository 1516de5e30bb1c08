"""JSON as text: what is read, and members that stand twice."""

import json

import pytest

from skyway.json_text import Path, json_value, repeated_member

MARK = b"\xef\xbb\xbf"


def test_a_byte_order_mark_before_the_text_is_not_read() -> None:
    assert json_value(MARK + b'{"a": 1}') == {"a": 1}


def test_a_whole_number_of_5000_digits_is_infinite() -> None:
    assert json_value(f'{{"a": {"9" * 5_000}}}') == {"a": float("inf")}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (b'{"a": "\xff"}', "the text is not UTF-8"),
        (b'{"a": 1}'.decode().encode("utf-16"), "the text is not UTF-8"),
        (b"[" * 100_000, "the text nests too deeply"),
        (b"{", "not JSON at line 1, column 2"),
    ],
)
def test_what_is_no_json_is_refused_in_plain_words(text: bytes, fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        json_value(text)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('{"a": 1, "a": 1}', ("a",)),
        ('{"a": 1, "b": {"c": [1, {"a": 2, "a": 3}]}}', ("b", "c", 1, "a")),
        ('{"a": 1, "\\u0061": 2}', ("a",)),
        ('{"a" : 1, "a"\t:2}', ("a",)),
        ('[{"a": 1}, {"a": 2}]', None),
        ('{"a": {"a": {"a": 1}}}', None),
        ('{"a": "b", "c": "b"}', None),
        ('{"a": ",", "b": ":", ":": "\\":", "c": "\\"a\\": 1"}', None),
        ('{"a": "x", ":k": 1, "m": 1, "m": 2}', ("m",)),
        ('["a", "a"]', None),
        ("1", None),
        ('""', None),
    ],
)
def test_a_member_that_stands_twice_is_found_with_its_place(text: str, place: Path | None) -> None:
    assert repeated_member(text.encode()) == place
    assert json.loads(text) is not None
