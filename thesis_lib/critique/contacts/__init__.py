"""Contacts of a body, from the state before to the state after: laws with effects, and the kinds of contact."""
