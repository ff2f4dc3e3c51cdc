"""What only motions in a plane have: a spin that nobody measured, and bodies that two sets of heights tell apart."""
