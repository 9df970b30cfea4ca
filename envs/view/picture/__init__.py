"""Pictures of a scene, with or without a display."""
