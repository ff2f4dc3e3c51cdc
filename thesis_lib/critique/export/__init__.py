"""A fitted model as a file of a physics engine: MJCF, SDF or URDF, written new or patched into a user's own."""
