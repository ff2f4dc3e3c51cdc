"""The mass-to-inertia ratio m/I of one dropped body (thesis 2.4, table 2.1)."""
