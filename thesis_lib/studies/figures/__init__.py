"""Pictures of the proof of the critique."""
