"""Which missions a closure hits, and the request for other plans for them.

`hits` decides what a closure meets, `impact` finds and changes the missions, `ground_stops` looks
again while ground stops last, `store` holds the SQL.
"""
