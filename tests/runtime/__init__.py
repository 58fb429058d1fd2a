"""The C++ runtime: driver, integrators, generic twin."""
