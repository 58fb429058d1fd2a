"""The run stage: run files, roads, and what a simulator gives back."""
