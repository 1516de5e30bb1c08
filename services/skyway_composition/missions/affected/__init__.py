"""Whom a closure hits: the missions that would land, charge, fly or take off there."""
