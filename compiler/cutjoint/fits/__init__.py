"""Fits: numbers of a model from measurements, and what these leave open.

Layers: `document` and `data` read files, `reading` makes a `records.Study` of them, `residuals` runs it with exact sensitivities,
`identify` judges its Jacobian, `fit` solves and judges, `writing` and `page` write what was found.
"""
