"""The small world of `skyway up --demo`: a few fleets, and customers who go on requesting."""
