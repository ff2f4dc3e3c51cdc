"""Observations of bodies in space: hits, episodes and flights, from samples or stated impacts."""
