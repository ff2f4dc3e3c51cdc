"""Chapter 2: inertial parameters and contact forces of mechanisms, identified from noisy motion."""
