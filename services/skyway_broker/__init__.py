"""The embedded broker: amqtt with its holes closed, our rights, and Mosquitto's password file.

What it owes to Mosquitto, and what it leaves out (persistent sessions, mqtt_qos 2), is written in
`hardened`. It keeps nothing over a restart, and needs not to: no fact lives only in a broker.
"""
