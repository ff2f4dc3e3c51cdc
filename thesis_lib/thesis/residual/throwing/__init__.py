"""Simulated throws with uncertain contacts, and predictive distributions of the resting position (thesis 4.3.3)."""
