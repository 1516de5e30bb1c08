"""Tests of `skyway verify` on the databases of a system that has really run."""
