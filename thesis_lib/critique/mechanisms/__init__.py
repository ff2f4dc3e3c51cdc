"""Critique of mechanisms (arm, wheel): find the force that the believed equations of motion lack."""
