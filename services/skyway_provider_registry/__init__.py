"""The provider registry: who could fly. It owns providers, fleets, presence and broker accounts.

Rooms: `providers` (names, tariffs, terms), `fleets` (drones and drone models), `enrolment` (who may
log in to the broker), `presence` (what drones said last), `candidates` (who could fly a request).
"""
