"""Questions for motions in a plane only: a spin that nobody measured, and bodies told apart by two sets of heights."""
