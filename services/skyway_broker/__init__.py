"""The embedded broker (a hardened amqtt), with our access rules and Mosquitto's password file.

`hardened` says how it resembles Mosquitto and what it leaves out (persistent sessions, mqtt_qos 2).
`limits` has the numbers of what one client, one account and one address may use; `door`, `gate`,
`introduction` and `usage` hold connections to them, `client`, `messages` and `retained` messages.
`refused_logins` counts logins that were refused.
It keeps nothing over a restart, and nothing is lost then: the databases hold every fact.
"""
