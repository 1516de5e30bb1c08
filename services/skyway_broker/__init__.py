"""The embedded broker (a hardened amqtt), with our access rules and Mosquitto's password file.

`hardened` says how it resembles Mosquitto and what it leaves out (persistent sessions, mqtt_qos 2).
It keeps nothing over a restart, and nothing is lost then: the databases hold every fact.
"""
