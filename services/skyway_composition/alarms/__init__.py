"""Alarms: what operators must look at, until one of them has."""
