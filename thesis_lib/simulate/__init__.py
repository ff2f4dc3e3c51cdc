"""Simulators of bodies and mechanisms in contact: time stepping, our own compliant contact, MuJoCo and Drake."""
