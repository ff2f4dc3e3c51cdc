"""Forces at impact, and the mass-to-inertia ratio m/I from measured impacts (thesis 2.5)."""
