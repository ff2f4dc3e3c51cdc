"""Effects and laws of one's own: loaded from a file or an installed package, checked, named with their origin."""
