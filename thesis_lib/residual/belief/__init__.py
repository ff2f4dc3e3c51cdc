"""Throws of many particles, and beliefs over where they come to rest (thesis 4.3.3)."""
