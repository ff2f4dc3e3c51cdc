"""The critique of drops: which impact law fails where, and which physical effect is missing."""
