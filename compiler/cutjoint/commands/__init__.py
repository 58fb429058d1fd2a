"""The commands, one module each; `cli.py` has their names and imports the requested one."""
