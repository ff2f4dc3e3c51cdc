"""Chapter 5: a robot that learns the mechanics of a Jenga tower and plays (independent of the other packages)."""
