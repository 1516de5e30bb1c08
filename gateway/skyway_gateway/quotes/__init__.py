"""Offers before a delivery is requested: they reserve nothing, unless they are asked to be held.

`make_quote` makes quotes of requests that `check_request` has checked. `accept_offer` has
composition keep an offer, and accepts the offer. `store` has the SQL.
"""
