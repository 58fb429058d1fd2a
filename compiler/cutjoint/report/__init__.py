"""What people are shown: tables for the terminal, plots."""
