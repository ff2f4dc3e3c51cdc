"""Simulated throws with uncertain contacts, and beliefs over where a body comes to rest (thesis 4.3.3)."""
