"""Learned contact models (thesis 4.3)."""
