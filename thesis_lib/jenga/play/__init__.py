"""Policies, the model predictive controller and the game."""
