"""The composition planner: which segments, in which order, recharging where and how much.

Start with `compose`; `problem` says what is asked, `skyway.delivery.plan` what comes out.
"""

from skyway.planner.compose import compose

__all__ = ["compose"]
