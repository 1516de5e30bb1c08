"""Enrolment tokens: each shown once, exchanged once, and good for thirty days."""
