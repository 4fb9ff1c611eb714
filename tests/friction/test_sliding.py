"""The sliding study's recipe: its potential against the forces, and the rows that it wrote."""

from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parents[2] / "data" / "friction"


def test_rows__slope_of_the_potential_is_the_half_planes_force():
    rows = pd.read_csv(HERE / "sliding.csv")
    keys = ["a_over_R", "b_over_R", "p_over_E", "corner_segments"]
    groups = [one.sort_values("offset") for _, one in rows[rows["mu"] == 0].groupby(keys)]
    for one in (one for one in groups if len(one) == 12):
        way = one["offset"] * (one["a_over_R"] + one["b_over_R"])
        force = -np.diff(one["potential_over_WR"]) / np.diff(way)
        half_plane = one["half_plane_over_W"].to_numpy()
        apart = force - 0.5 * (half_plane[1:] + half_plane[:-1])
        # Of the mesh and of finite strain, of the load: 1.2e-4 seen on wide grooves.
        assert np.sqrt(np.mean(apart**2)) < 1.5e-4


def test_rows__with_friction_resist_by_the_coefficient_once_all_slides():
    rows = pd.read_csv(HERE / "sliding.csv")
    slid = rows[(rows["mu"] > 0) & (rows["offset"] > 0.2)]
    # Ridges' corners and a mesh of four segments a corner: 1.5 to 2 % more is seen.
    assert (-slid["lateral_over_W"] / slid["mu"]).between(1.0, 1.03).all()
