"""Files that a model file names: tables, roads, properties of tyres, submodels."""
