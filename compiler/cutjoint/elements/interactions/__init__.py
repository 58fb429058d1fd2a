"""The interactions, each in a file of its own."""
