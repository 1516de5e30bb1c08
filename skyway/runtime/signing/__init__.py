"""Signatures of the messages between cloud and drones (Ed25519, libsodium).

`key_pair` signs and verifies bytes. `seal` signs what a process publishes, and refuses what a drone
must not obey. `key_book` knows the keys of drones; `mqtt.signature_check` asks it. `cloud_key_file`
reads the cloud's own keys, and `fleet_keys` makes those of drones that are being registered.
"""
