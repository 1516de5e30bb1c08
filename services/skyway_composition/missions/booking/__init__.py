"""Booking: the best offer for a delivery becomes its missions, in one transaction.

`book` books, in `rounds` that propose the best offer. `engage` claims drones and pads and adds the
missions, `routes` serves the gateway, `store` has the SQL. `clear_way`
makes standbys of other drones give way to a delivery: `standby_store` finds them.

`keep_offer` holds the best offers of a quote, and an offer that is being accepted. `hold_store` is
what is stored, and whether it can be booked as it is held.
"""
