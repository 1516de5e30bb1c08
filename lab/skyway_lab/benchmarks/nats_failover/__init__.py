"""Three nodes of NATS, of which one is killed while drones get instructions.

`cluster` runs the nodes. `light_drones` are clients with the topics and rights of drones, and a
sender that repeats each instruction until it is answered. `flown` is a whole Skyway on the cluster,
whose drones fly missions.
"""
