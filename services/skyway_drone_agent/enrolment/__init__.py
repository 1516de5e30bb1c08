"""Enrolment: how a drone gets, keeps and changes its credentials."""
