"""Arm and wheel in MuJoCo and in Drake, with the engines' own contact, recorded by simulated sensors of a rig."""
