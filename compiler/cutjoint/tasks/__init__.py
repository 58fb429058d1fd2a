"""Tasks other than single runs: batches, real-time steps, equilibria."""
