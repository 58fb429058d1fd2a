"""The installed package: its version, its folders, and additions of other packages."""
