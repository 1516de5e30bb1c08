"""Counts the clicks of a story: somebody is done with few of them."""

from playwright.sync_api import Locator


class Clicks:
    """Clicks and presses of Enter are counted; what is typed or chosen from a list is not."""

    def __init__(self) -> None:
        self.count = 0

    def click(self, target: Locator) -> None:
        """Click, or tap."""
        target.click()
        self.count += 1

    def press(self, target: Locator, key: str) -> None:
        """Press a key; Enter counts as a click."""
        target.press(key)
        self.count += key == "Enter"
