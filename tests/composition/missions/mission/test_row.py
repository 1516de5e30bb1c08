"""What was written or read lately is not parsed again; another text always is."""

from skyway_composition.missions.mission.row import JsonCache

from skyway.json_model import JsonModel


class Note(JsonModel):
    text: str


def test_what_was_written_is_read_as_the_same_value() -> None:
    known, note = JsonCache(Note), Note(text="a")

    assert known.read(known.write(note)) is note


def test_what_was_read_is_not_parsed_again() -> None:
    known = JsonCache(Note)

    assert known.read('{"text": "a"}') is known.read('{"text": "a"}')


def test_a_text_that_somebody_else_wrote_is_parsed() -> None:
    known = JsonCache(Note)
    known.write(Note(text="a"))

    assert known.read('{"text":"b","of_a_newer_version":1}') == Note(text="b")


def test_what_is_known_for_long_is_parsed_again() -> None:
    known, note = JsonCache(Note), Note(text="first")
    text = known.write(note)
    for number in range(500):
        known.write(Note(text=str(number)))

    assert known.read(text) == note
    assert known.read(text) is not note
