"""Booking missions for packages that wait.

`run_bookings` is the loop, `book` is one round of one delivery. `booking_round` decides what to ask
for, and whether a later round can help. `queue_store` is the queue.
`horizon` requests deliveries whose pickup was too far ahead when they were accepted.
"""
