"""Signatures of the messages between cloud and drones (Ed25519, libsodium).

`key_pair` signs and verifies bytes. `seal` signs what a process publishes, and refuses what a drone
must not obey. `key_book` knows the keys of drones, and `check` holds a message until its sender is
proven. `fleet_keys` makes the keys of drones that are being registered.
"""
