"""The compiler as a whole: its pipeline, systems, programs as data, folders that stand alone, and the cache of prepared runs."""
