"""How do counts change if the finger lands beside a groove's middle?
==================================================================

The forms are for a body centred on a groove. A body that lands off centre reaches ridges one by
one, not in pairs. The black line is the mean over all places.

.. image:: images/sphx_glr_off_centre_001.png
   :alt: How do counts change if the finger lands beside a groove's middle?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb


def scene(offset):
    """Return quarter-millimetre ridges under a fingertip that is off by a part of a pitch."""
    texture = {"ridge_width": "0.25 mm", "groove_width": "0.25 mm", "offset": offset}
    body = {"radius": "8 mm", "youngs_modulus": "60 kPa"}
    return rb.Scene.from_dict({"body": body, "texture": texture, "load": {"max": "1.2 kPa"}})


load = np.linspace(0.02, 1.2, 60)  # kPa
figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
for offset in (0.0, 0.25, 0.5):
    found = rb.contact_at_loads(scene(offset), load / 60)
    axis.step(load, found["Q"], where="mid", label=f"off by {offset:g} of a pitch")
mean = rb.contact_at_loads(scene("uniform"), load / 60)
axis.plot(load, mean["Q"], color="black", label="mean over all places")
axis.set(xlabel="load, kPa", ylabel="ridges in contact")
axis.legend(frameon=False)
