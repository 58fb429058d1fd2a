"""The compiler as a whole: its pipeline, systems, programs as data, C exports, and the cache of prepared runs."""
