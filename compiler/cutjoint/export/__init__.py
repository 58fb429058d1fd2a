"""Models for other programs: as FMUs, and what exporters of other packages share with views."""
