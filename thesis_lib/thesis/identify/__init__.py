"""Chapter 2: identification of inertial parameters and contact forces of mechanisms from noisy motion."""
