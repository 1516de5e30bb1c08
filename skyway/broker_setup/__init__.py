"""The files that a broker needs: its passwords, certificates and configuration.

`passwords` writes and checks Mosquitto's password file, which the embedded broker reads too.
`certificates` is the authority of a deployment, `mosquitto` the configuration of Mosquitto, and
`private_file` writes files that only their owner can read.
"""
