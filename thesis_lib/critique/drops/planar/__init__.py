"""Questions for motions in a plane only: the friction of a table, and bodies told apart by two sets of heights."""
