"""Drops with compliant contact, simulated in continuous time."""
