"""Models reduced to the parts that a scene needs."""
