"""The sliding path of an impact in space, compiled."""
