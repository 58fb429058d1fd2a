"""Tasks beside a run: batches, steps against the clock, equilibria."""
