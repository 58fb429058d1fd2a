"""Reports: tables for the terminal, plots."""
