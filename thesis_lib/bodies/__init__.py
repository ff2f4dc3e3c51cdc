"""Rigid bodies: planar shapes, solids, their inertia, and the stated properties of the rig that drops them."""
