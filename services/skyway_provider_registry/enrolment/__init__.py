"""Enrolment: who may log in to the broker; the password file holds these accounts and no others."""
