"""Rehearsals: whole stories of a drone in one process, with every accident a seed can think of.

The real agent flies, a fake cloud sends it on missions, and time is virtual: nothing ever waits.
What a story's seed has decided happens again in every run of it.
"""
