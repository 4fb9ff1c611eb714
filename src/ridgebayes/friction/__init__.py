"""Input to friction models: joint draws of counts and of the contacts that go with them.

`inputs.friction_inputs` gives them as an xarray Dataset, `files.write_inputs` writes them.
"""
