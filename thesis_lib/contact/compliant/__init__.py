"""Contacts that take time: their normal forces, and the motion of bodies on them."""
