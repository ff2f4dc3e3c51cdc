"""Shared by all simulated drops: releases, hidden causes, the camera."""
