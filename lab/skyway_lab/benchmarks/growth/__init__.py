"""What a delivery costs in a system that has grown: many past deliveries, drones and stations.

Each run starts a system, has it fly a delivery, stops it, copies that delivery and a drone as often
as the size says, starts the system again, and loads it for a short time. The copies are like the
rows that services write, with other ids and times; `skyway verify` does not accept them.
"""
