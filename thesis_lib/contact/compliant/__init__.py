"""Compliant contacts of finite duration: their normal forces, and the motion of bodies in contact."""
