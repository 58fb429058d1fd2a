"""Other simulators: the programs that `cutjoint export` writes, compiled and run."""
