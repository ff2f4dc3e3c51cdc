"""Identification of contact parameters (thesis sections 3.3.3 and 3.4)."""
