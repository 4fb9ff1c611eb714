"""Friction: joint draws of counts and contacts, a friction model, and its calibration.

`inputs.friction_inputs` returns the draws as an xarray Dataset, and `files.write_inputs` writes
them. `friction_model` predicts the coefficient of friction, and `calibration` fits the model.
"""
