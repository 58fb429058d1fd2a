"""Models as programs for other simulators: peers in which the same mechanism runs."""
