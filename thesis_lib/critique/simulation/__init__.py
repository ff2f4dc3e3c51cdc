"""A model with its effects acting in a simulator."""
