"""The documents of the rendered chart, and how tests find things in them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

#: An object of Kubernetes, or a part of one: its members have every type.
Document = dict[str, Any]

_COMPONENT = "app.kubernetes.io/component"


@dataclass(frozen=True, slots=True)
class Pod:
    """A template of pods: what makes it, its labels and its `spec`."""

    kind: str
    name: str
    labels: Mapping[str, str]
    spec: Document

    @property
    def component(self) -> str:
        """The part of Skyway that runs there."""
        return self.labels[_COMPONENT]

    @property
    def containers(self) -> Sequence[Document]:
        """Its containers, with those that run before them."""
        return [*self.spec.get("initContainers", ()), *self.spec["containers"]]

    @property
    def ports(self) -> Mapping[str, int]:
        """The named ports of its containers."""
        return {
            port["name"]: port["containerPort"]
            for each in self.spec["containers"]
            for port in each.get("ports", ())
        }

    def secrets(self) -> Mapping[str, Sequence[str] | None]:
        """The mounted Secrets, and the keys that are mounted; None for all."""
        return {
            volume["secret"]["secretName"]: (
                [item["key"] for item in volume["secret"]["items"]]
                if "items" in volume["secret"]
                else None
            )
            for volume in self.spec["volumes"]
            if "secret" in volume
        }


class Documents:
    """All objects of one rendered case."""

    def __init__(self, documents: Sequence[Document]) -> None:
        self.all = documents

    def of(self, *kinds: str) -> list[Document]:
        """The objects of these kinds."""
        return [each for each in self.all if each["kind"] in kinds]

    def one(self, kind: str, name: str) -> Document:
        """The object of this kind whose name ends so."""
        return next(each for each in self.of(kind) if each["metadata"]["name"].endswith(name))

    def pods(self) -> Iterator[Pod]:
        """The templates of all pods."""
        for each in self.of("Deployment", "Job"):
            template = each["spec"]["template"]
            name = each["metadata"]["name"]
            yield Pod(each["kind"], name, template["metadata"]["labels"], template["spec"])

    def running(self) -> dict[str, Pod]:
        """The pods that stay, by their component."""
        return {pod.component: pod for pod in self.pods() if pod.kind == "Deployment"}


class Outcomes:
    """What became of every case. Any: documents and findings are JSON of every kind."""

    def __init__(self, outcomes: Mapping[str, Document]) -> None:
        self._outcomes = outcomes

    def __getitem__(self, case: str) -> Documents:
        """The documents of a case that was rendered."""
        return Documents(self._outcomes[case]["documents"])

    def findings(self, case: str, kind: str) -> Any:
        """The `lint`, `invalid`, `notes` or `error` of a case; None where it has none."""
        return self._outcomes[case].get(kind)


def environment(container: Document) -> dict[str, str]:
    """The variables of a container."""
    return {each["name"]: each["value"] for each in container.get("env", ())}


def selects(selector: Document, labels: Mapping[str, str]) -> bool:
    """Whether a selector by labels chooses pods with these labels."""
    chosen: Mapping[str, str] = selector["matchLabels"]
    return chosen.items() <= labels.items()
