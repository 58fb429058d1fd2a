"""The former place of `generic.backend`, for installations that have not been set up again."""
