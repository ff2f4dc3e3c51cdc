"""Shared by all simulated drops: releases, hidden causes, camera and tracker."""
