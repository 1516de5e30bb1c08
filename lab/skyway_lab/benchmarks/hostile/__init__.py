"""Rogues with valid credentials beside an honest tenant: a whole system, judged from outside.

Rogue customers, providers, drones and callers without a key send every call and every message with
extreme values. Meanwhile the deliveries, quotes, lists, notifications and revocations of everybody
else must go on.
"""
