"""What the gateway answers in the end: every delivery, open alarms, webhooks that are retried."""

from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Any, Final

import httpx
from skyway_lab.benchmarks.chaos.customers import Accepted
from skyway_lab.benchmarks.chaos.evidence import Awaited, FinalAnswer
from skyway_lab.benchmarks.chaos.judgement import TERMINAL

from skyway.ids import DeliveryId, DroneId, MissionId, PackageId

_TIMEOUT_S: Final = 30.0
#: What a delivery shows, and the alarm that operators get, when its drone does not report.
OUT_OF_CONTACT: Final = "OUT_OF_CONTACT"
_ASKING: Final = "MISSION_IN_DOUBT"


class FinalQuestions:
    """Asks the gateway, not over the customers' wire."""

    def __init__(self, client: httpx.AsyncClient, *, operator_key: str) -> None:
        self._client = client
        self._operator_key = operator_key

    @classmethod
    def client(cls, url: str) -> httpx.AsyncClient:
        """A client for the questions."""
        return httpx.AsyncClient(base_url=url, timeout=_TIMEOUT_S)

    async def deliveries(self, accepted: Iterable[Accepted]) -> dict[DeliveryId, FinalAnswer]:
        """Each delivery as its customer sees it."""
        answers = {}
        for one in accepted:
            path = f"/v1/deliveries/{one.delivery_id}"
            try:
                answer = await self._get(path, key=one.customer.key)
            except httpx.HTTPError as error:
                answers[one.delivery_id] = FinalAnswer(f"not shown: {error!r:.200}")
                continue
            if answer.status_code == HTTPStatus.NOT_FOUND:
                answers[one.delivery_id] = FinalAnswer(None)
                continue
            shown = answer.json()
            answers[one.delivery_id] = FinalAnswer(
                state=shown["state"],
                activity=shown["activity"],
                package_states={
                    PackageId(each["package_id"]): each["state"] for each in shown["packages"]
                },
                mission_ids=tuple(MissionId(each["mission_id"]) for each in shown["missions"]),
            )
        return answers

    async def awaited(self, answers: Mapping[DeliveryId, FinalAnswer]) -> dict[DeliveryId, Awaited]:
        """Deliveries that have not ended and of whose missions an open alarm asks operators."""
        missions = {
            mission_id: delivery_id
            for delivery_id, answer in answers.items()
            if answer.activity == OUT_OF_CONTACT and answer.state not in TERMINAL
            for mission_id in answer.mission_ids
        }
        if not missions:
            return {}
        return {
            missions[alarm["mission_id"]]: Awaited(DroneId(alarm["drone_id"]), alarm["detail"])
            for alarm in await self._pages("/v1/alarms?state=OPEN", key=self._operator_key)
            if alarm["code"] == _ASKING and alarm["mission_id"] in missions
        }

    async def retried(self, webhooks: Mapping[str, str]) -> frozenset[DeliveryId]:
        """Deliveries with a webhook that failed visibly and is tried again; `webhooks` by key."""
        found: set[DeliveryId] = set()
        for key, webhook_id in webhooks.items():
            newest: dict[str, Any] = {}  # attempts as JSON, by event
            for attempt in await self._pages(f"/v1/webhooks/{webhook_id}/attempts?", key=key):
                newest.setdefault(attempt["event_id"], attempt)
            found |= {
                DeliveryId(attempt["delivery_id"])
                for attempt in newest.values()
                if attempt["outcome"] == "FAILED" and attempt["next_try_wall_at"] is not None
            }
        return frozenset(found)

    async def _pages(self, path: str, *, key: str) -> list[dict[str, Any]]:  # items as JSON
        items: list[dict[str, Any]] = []
        cursor = ""
        while True:
            try:
                answer = await self._get(f"{path}&limit=200{cursor}", key=key)
            except httpx.HTTPError:
                return items
            page = answer.json()
            items += page["items"]
            if page["next_cursor"] is None:
                return items
            cursor = f"&cursor={page['next_cursor']}"

    async def _get(self, path: str, *, key: str) -> httpx.Response:
        answer = await self._client.get(path, headers={"Authorization": f"Bearer {key}"})
        if answer.status_code == HTTPStatus.NOT_FOUND:
            return answer
        return answer.raise_for_status()
