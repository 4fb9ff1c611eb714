"""Two-scale and half-plane loads against finite elements: ``python docs/two-scale/compare.py``.

Run it from the repository's root, with it on the path; it writes compare.csv and compare.png here.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import load_of, relative_error
from ridgebayes.drawing.style import COLOURS, WIDTH, as_bytes, new_figure, styled

HERE, DATA = Path(__file__).parent, Path("data/fea")
CALCULIX = ("neo_hooke", "calculix_rounded")
KEYS = ["a_over_R", "b_over_R", "nu", "offset_over_R", "corner_radius_over_R"]


def compare() -> pd.DataFrame:
    """Return both errors of each row of finite elements, and what two scales say of theirs."""
    names = ("cylinder_sweep", "rounded_corners", *CALCULIX)
    parts = [pd.read_csv(DATA / f"{name}.csv").assign(rows=name) for name in names]
    fe = pd.concat(parts, ignore_index=True).fillna(dict.fromkeys(KEYS, 0.0))
    found = []
    for key, rows in fe.groupby(KEYS):
        a, b, nu, offset, corner = key
        factor = load_factor(nu)
        profile = Profile(a, b, corner=corner, offset=offset / (a + b))
        top = 1.05 * factor * rows["p_over_E"].max()
        events = reaching_loads(profile, W_max=top, rel_tol=1e-6)
        known = dict(zip(events.Q.tolist(), events.W / factor, strict=True))
        p, half_plane = rows["p_over_E"], rows["Q"].map(known)
        found.append(
            rows[[*KEYS, "rows", "Q", "p_over_E", "rel_se"]].assign(
                ridge_pressure=2 * p / ((rows["Q"] - 2) * a),
                half_plane_error=half_plane / p - 1,
                two_scale_error=load_of(half_plane, nu) / p - 1,
                two_scale_rel_se=relative_error(p, profile, nu),
            )
        )
    return pd.concat(found, ignore_index=True).dropna(subset=["half_plane_error"])


@styled()
def draw(frame: pd.DataFrame) -> None:
    """Draw both errors against the load and against the mean pressure on a ridge."""
    figure = new_figure(WIDTH, 4.2)
    for axes, (x, label) in zip(
        figure.subplots(1, 2, sharey=True),
        (("p_over_E", "load $p/E$"), ("ridge_pressure", "mean ridge pressure over $E$")),
        strict=True,
    ):
        by_calculix = frame["rows"].isin(CALCULIX)
        for name, some, marker, colour, what in (
            ("half_plane", by_calculix.notna(), "x", "classic", "half-plane"),
            ("two_scale", ~by_calculix, "o", "modified", "two-scale"),
            ("two_scale", by_calculix, "^", "hybrid", "two-scale, against CalculiX"),
        ):
            axes.loglog(
                frame[x][some],
                100 * np.maximum(frame[f"{name}_error"][some].abs(), 1e-5),
                marker,
                color=COLOURS[colour],
                markersize=4,
                label=what if x == "p_over_E" else None,
            )
        axes.set_xlabel(label)
        axes.axhline(0.1, color="#000000", linewidth=0.8, linestyle=":")
        if x == "p_over_E":
            axes.set_ylabel("load off finite elements (%)")
    figure.legend(loc="outside upper center", ncols=3)
    (HERE / "compare.png").write_bytes(as_bytes(figure, "png"))


if __name__ == "__main__":
    table = compare()
    table.to_csv(HERE / "compare.csv", index=False, float_format="%.6g")
    draw(table)
    scaled = table["two_scale_error"] / np.hypot(table["rel_se"], table["two_scale_rel_se"])
    print(len(table), "rows;", f"{(scaled.abs() < 1.96).mean():.3f} within 1.96 standard errors")
    bands = pd.cut(table["p_over_E"], [0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5])
    columns = table[["half_plane_error", "two_scale_error"]].abs()
    print((100 * columns.groupby(bands, observed=True).max()).round(2))
    print("off CalculiX:")
    print(table[table["rows"].isin(CALCULIX)].round(6).to_string(index=False))
