"""Enrolment: how a drone gets, keeps and changes what it shows to the cloud."""
