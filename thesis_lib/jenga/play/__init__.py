"""Who plays, and the game itself."""
