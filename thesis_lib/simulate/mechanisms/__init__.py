"""Simulated motions of chapter 2: bodies, releases, torques, noise and hidden forces."""
