"""The report of a bench: charts, tables and a page that stands alone."""
