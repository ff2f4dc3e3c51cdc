"""Planar rigid bodies: shapes, inertia, gap and contact Jacobians."""
