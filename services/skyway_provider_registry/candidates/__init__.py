"""Candidates: who could fly a request, and why the others cannot."""
