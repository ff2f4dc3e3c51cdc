"""Policies, the controller and the game."""
