"""What can be said of a formulated model without compiling it."""
