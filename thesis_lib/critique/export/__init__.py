"""Export of a fitted model to a physics engine: MJCF, SDF or URDF, as a new file or as a patch of a user's file."""
