"""Planar rigid bodies: their shapes, their inertia, and what is believed of the rig that drops them."""
