"""A console in a browser, as somebody with a key uses it."""

from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Locator, expect

from tests.end_to_end.browser import WatchedPage, serious_problems


class ConsolePage(WatchedPage):
    """A console that is open in a browser context of its own."""

    def __init__(self, browser: Browser, system: Any) -> None:
        self.gateway_url: str = system.keys["SKYWAY_GATEWAY_URL"]
        self._system = system
        self._key = ""
        super().__init__(browser, self.gateway_url, viewport={"width": 1280, "height": 800})

    def open_with(self, key: str) -> "ConsolePage":
        """Log in by a link of this key, as `skyway console` prints it."""
        self._key = key
        link = self._system.call("POST", "/v1/session-links", key=key).json()["url"]
        self.page.goto(f"{self.gateway_url}/console#{urlsplit(link).fragment}")
        expect(self.page.get_by_role("navigation", name="Views")).to_be_visible()
        expect(self.page.locator(".connection")).to_have_text("Live")
        return self

    def show(self, *parts: str) -> "ConsolePage":
        """Open a view by its address."""
        self.page.evaluate("path => { location.hash = path }", "#/" + "/".join(parts))
        return self

    def panel(self, name: str) -> Locator:
        """A panel beside the map."""
        return self.page.get_by_role("region", name=name)

    def drone_name(self, drone_id: str) -> str:
        """What the console calls a drone that is in the live picture."""
        name: str = self.page.evaluate(
            "async (id) => (await import('/console/drone_names.js')).droneName(id)", drone_id
        )
        return name

    def replay_from(self, moment: str) -> None:
        """Choose the hour of the replay that begins with the minute of this moment."""
        minute = self.page.evaluate(
            """(moment) => {
              const date = new Date(moment);
              const local = new Date(date.getTime() - date.getTimezoneOffset() * 60_000);
              return local.toISOString().slice(0, 16);
            }""",
            moment,
        )
        self.page.get_by_label("From", exact=True).fill(minute)

    def confirm(self, reason: str, *, after: str) -> None:
        """Confirm in the dialog, after it has said what would happen."""
        dialog = self.page.get_by_role("dialog")
        expect(dialog).to_contain_text(after)
        dialog.get_by_label("Reason").fill(reason)
        dialog.locator("button.danger").click()
        expect(dialog).to_have_count(0)

    def agree(self, *, after: str) -> None:
        """Agree in a dialog that needs no reason, after it has said what would happen."""
        dialog = self.page.get_by_role("dialog")
        expect(dialog).to_contain_text(after)
        dialog.locator("button.danger").click()
        expect(dialog).to_have_count(0)

    def show_key(self, key: str | None = None) -> None:
        """Type the API key where the console asks for it again: that of the login, or another."""
        dialog = self.page.get_by_role("dialog", name="Your API key again")
        dialog.get_by_label("API key").fill(key or self._key)
        dialog.get_by_role("button", name="Go on").click()
        expect(dialog).to_have_count(0)

    def open_again(self, closed: Locator) -> None:
        """Open what an entry of a list or a panel shows as closed."""
        closed.get_by_role("button", name="Open again").click()
        self.agree(after="may")

    def serious_problems(self) -> list[str]:
        """What axe finds serious in the view that is open, in both themes, when it has loaded."""
        return serious_problems(self.page)

    def sound(self) -> bool:
        """Whether nothing happened that must not: errors, and requests to other hosts."""
        return (self.foreign, self.errors) == ([], [])
