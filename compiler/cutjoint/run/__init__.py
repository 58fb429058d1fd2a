"""The run stage: run files, roads, and results of simulators."""
