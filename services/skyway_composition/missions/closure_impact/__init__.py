"""Which missions a closure hits, and the request for other plans for them.

`hits` decides what a closure meets, `impact` finds and changes the missions, also while a ground
stop lasts, `store` holds the SQL.
"""
