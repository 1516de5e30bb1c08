"""Booking: the best offer for a delivery becomes its missions, in one transaction.

`book` runs the rounds, `engage` claims drones and pads and adds the missions, `outcome` answers
when no mission can be booked, `routes` serves the gateway, `store` holds the SQL.
"""
