"""The studies behind the figures of README and docs, each a program: `python -m cutjoint_bench.studies.NAME`, in a checkout."""
