"""Rigid bodies: planar shapes, solids, their inertia, and what is believed of the rig that drops them."""
