"""The critique of mechanisms (arm, wheel): which force is missing from the believed equations of motion."""
