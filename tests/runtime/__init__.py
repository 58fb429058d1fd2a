"""The C++ runtime: driver, integrators, generic solver."""
