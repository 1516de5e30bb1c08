"""Booking missions for packages that wait.

`run_bookings` has the loops: one books what is queued, one requests deliveries whose pickup was too
far ahead when they were accepted. `book` is one round of one delivery. `booking_round` decides what
to ask for, and whether a later round can help. `queue_store` is the queue, and `wake_waiting` wakes
requests that wait in it.
"""
