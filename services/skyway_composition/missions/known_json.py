"""Values by their JSON: what this process wrote or read lately is not parsed again.

A drone answers about a second after its mission was booked, most often to the replica that booked
it. The text comes from the database each time, so what another replica has written meanwhile is
another text, and is parsed: nothing here can be out of date.
"""

from typing import Final, Generic, TypeVar

from skyway.json_model import JsonModel

J = TypeVar("J", bound=JsonModel)

#: Values of one model that are known, those of the last 15 seconds under load: 5 MiB.
_MOST: Final = 500


class KnownJson(Generic[J]):
    """The JSON of one model's values, which are frozen: whoever reads a text shares its value."""

    def __init__(self, model: type[J]) -> None:
        self._model = model
        self._known: dict[str, J] = {}

    def write(self, value: J) -> str:
        """The JSON of a value, known from now on."""
        text = value.model_dump_json()
        self._keep(text, value)
        return text

    def read(self, text: str) -> J:
        """The value in this JSON."""
        value = self._known.get(text)
        if value is None:
            value = self._model.read(text)
            self._keep(text, value)
        return value

    def _keep(self, text: str, value: J) -> None:
        self._known[text] = value
        while len(self._known) > _MOST:
            del self._known[next(iter(self._known))]
