"""Drops with compliant contact in continuous time."""
