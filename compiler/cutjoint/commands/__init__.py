"""The commands, a module each, whose `command` is imported when it is asked for; `cli.py` has their names."""
