"""Chapter 2's motions: bodies, releases, torques, noise, hidden forces."""
