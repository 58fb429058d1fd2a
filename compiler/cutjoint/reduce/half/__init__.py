"""Models that are symmetric in their scene, cut in two."""
