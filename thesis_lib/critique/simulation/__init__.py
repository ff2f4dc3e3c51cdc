"""Simulation with a fitted model and its effects."""
