"""Folders of a checkout of the repository that studies read and write."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MODELS = ROOT / "models"
DATA = ROOT / "tests" / "data"
#: What git holds of measurements, and what it does not.
DOCS, RESULTS = ROOT / "docs" / "bench", ROOT / "results"
#: Of the report: `report.summary.summarise`.
SUMMARY = DOCS / "summary.json"
