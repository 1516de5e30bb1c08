"""The small world of `skyway up --demo`: shops, fleets, and a story of the day.

People who open the console find a service that works: shops request deliveries to stations not far
away, drones of three providers fly them, and every few minutes something happens.
"""
