"""Proofs of hand-overs are given here: typed, signed, uploaded, or said by the customer.

`accept_proof` decides and stores, `photos` keeps and erases photos, and `routes` are for customers,
providers, operators and drones. People give proof on the tracking page.
"""
