"""Fits: numbers of a model from measurements, and what these leave open.

Layers: `document` and `data` read files, `reading` makes a `records.Study` of them, `residuals` runs it with exact sensitivities,
`fit` judges its Jacobian, solves and judges the result, `writing` and `page` write what was found.
"""
