"""Signatures of the messages between cloud and drones (Ed25519, libsodium).

`key_pair` signs and verifies bytes, and makes the keys of drones that are being registered. `seal`
signs published messages, and refuses messages without a valid signature. `key_book` caches the keys
of drones for `mqtt.signature_check`. `cloud_key_file` reads the cloud's own keys.
"""
