"""What all simulated drops share: releases, hidden causes, the camera."""
