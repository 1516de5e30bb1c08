"""What customers say about people: recipients, sender, instructions, metadata.

`details` has the forms and their limits, `store` the SQL. Decision 0051 says who sees what, and for
how long.
"""
