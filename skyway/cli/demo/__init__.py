"""`skyway demo`: the world it registers, the scenario it plays, and what it shows of it."""
