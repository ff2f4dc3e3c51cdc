"""Estimation of the mass-to-inertia ratio m/I of a dropped body (thesis 2.4, table 2.1)."""
