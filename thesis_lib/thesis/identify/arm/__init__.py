"""Arm and disk: identification of base parameters and contact forces from noisy states and torques (thesis 2.4)."""
