"""Arm and wheel in MuJoCo and in Drake, with the engines' own contact, recorded as rigs record them."""
