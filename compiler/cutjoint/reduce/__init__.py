"""Models cut down to what a scene needs."""
