"""Pages of docs/ as a reader follows them."""
