"""Index-3 formulation in relative coordinates with the exact tangent of the recursion."""
