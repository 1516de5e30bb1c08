"""Replanning: a mission whose plan no longer holds gets a new revision."""
