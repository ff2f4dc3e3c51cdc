"""Simulated tosses of a body in space: releases, hidden causes, camera, and our own compliant contact."""
