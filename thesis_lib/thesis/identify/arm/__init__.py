"""Arm and disk: base parameters and contact forces from noisy states and torques (thesis 2.4)."""
