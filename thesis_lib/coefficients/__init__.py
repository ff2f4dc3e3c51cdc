"""Friction and restitution (μ, ε) of impact laws, fitted to many impacts and to each (thesis 3.3)."""
