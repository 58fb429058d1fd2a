"""The explanation of the Lagrangian formulations in natural coordinates."""
