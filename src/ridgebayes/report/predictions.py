# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on predictions: bands, held-out rows, percent errors, K, the smooth cylinder."""

from ridgebayes.checks.held_out import held_out_loads
from ridgebayes.checks.load_errors import has_slopes, percent_errors, shown_textures
from ridgebayes.checks.smooth import FIG_3_TEXTURE, smooth_cylinder
from ridgebayes.comparison.bands import AVERAGE
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form, forms_by_probability
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.names import form_name
from ridgebayes.report.numbers import ABSENT, count, decimals, number, percent

MOST_ROWS = 30


def bands_section(comparison: Comparison) -> Section:
    """Return Q against load with bands, texture by texture."""
    form = best_form(comparison) or next(iter(comparison.fits))
    return Section(
        "Q against load",
        "bands",
        (
            Picture(
                comparison,
                "bands",
                f"{form_name(form)}. Dark: the form's own curve; light: what a further simulation "
                "would show. Hatched: a count or an a/pitch beyond what was calibrated. The load "
                "axis is a root scale, on which steps are equally wide; bands of one count are "
                "drawn a quarter of an edge to either side.",
            ),
        ),
    )


def held_out_section(comparison: Comparison) -> Section:
    """Return the held-out rows beside their bands, inside or outside."""
    loads = held_out_loads(comparison)
    if not len(loads):
        return Section("Held-out rows", "held-out", ())
    prob = loads["prob"].iloc[0]
    best = best_form(comparison) or next(iter(comparison.fits))
    blocks: list[Text | Table | Picture] = [
        Text(
            f"{count(len(comparison.table.held_out), 'row')} were never fitted, only predicted. "
            f"Bands hold {percent(prob)} and include the error model."
        ),
        Picture(
            comparison,
            "held-out",
            "Predicted over observed load of each held-out transition; zero is a perfect "
            "prediction."
            + (
                " The power law knows nothing of a texture it has no K for and is left out there."
                if loads["prior_alone"].any()
                else ""
            ),
        ),
    ]
    rows = []
    forms = forms_by_probability(comparison)
    for form in forms if len(forms) == 1 else [*forms, AVERAGE]:
        part = loads[loads["form"] == form]
        error = 100 * (part["p_over_E_median"] / part["p_over_E_observed"] - 1)
        prior_only = bool(part["prior_alone"].all())
        rows.append(
            [
                form_name(form),
                f"{int(part['inside'].sum())} of {len(part)}",
                ABSENT
                if prior_only
                else f"{decimals(error.min(), 1)} to {decimals(error.max(), 1)}",
                "from its prior alone"
                if prior_only
                else "yes"
                if part["extrapolation"].any()
                else "no",
            ]
        )
    blocks.append(
        table(
            ["Form", f"Inside the {percent(prob)} band", "Load error, %", "Extrapolation"],
            rows,
            text=(0, 3),
        )
    )
    part = loads[loads["form"] == best].head(MOST_ROWS)
    blocks.append(
        table(
            ["a/R", "b/R", "Q", "Observed p/E", "Median", f"{percent(prob)} band", "Observed is"],
            [
                [
                    f"{row['a_over_R']:g}",
                    f"{row['b_over_R']:g}",
                    str(row["Q"]),
                    number(row["p_over_E_observed"], 5),
                    number(row["p_over_E_median"], 5),
                    f"{number(row['p_over_E_lower'], 5)} to {number(row['p_over_E_upper'], 5)}",
                    "inside" if row["inside"] else "outside",
                ]
                for row in part.to_dict("records")
            ],
            f"{form_name(best)}, row by row.",
            text=(6,),
            badge=6,
        )
    )
    return Section("Held-out rows", "held-out", tuple(blocks))


def errors_section(comparison: Comparison) -> Section:
    """Return the percent errors of each form (the study's Figs 5 and 6)."""
    textures = shown_textures(comparison)
    if not textures:
        return Section("Percent error of each form", "errors", ())
    errors = percent_errors(comparison, textures)
    calibrated = errors[errors["coefficients"] == "calibrated"]
    rows = []
    for name in forms_by_probability(comparison):
        cells = [form_name(name)]
        for a, b in textures:
            part = calibrated[
                (calibrated["form"] == name)
                & (calibrated["a_over_R"] == a)
                & (calibrated["b_over_R"] == b)
            ]["percent"]
            low, high = part.min(), part.max()
            cells.append(f"{decimals(low, 1)} to {decimals(high, 1)}" if len(part) else ABSENT)
        rows.append(cells)
    return Section(
        "Percent error of each form",
        "errors",
        (
            Picture(
                comparison,
                "percent-error",
                "100 (p form / p data − 1) at each transition: above zero the form asks for too "
                "much load. Full lines: coefficients calibrated here (posterior means); dashed: "
                "printed.",
            ),
            table(
                ["Form", *(f"a/R = {a:g}, b/R = {b:g}" for a, b in textures)],
                rows,
                "Smallest to largest load error in per cent, calibrated coefficients.",
            ),
        ),
    )


def slopes_section(comparison: Comparison) -> Section:
    """Return K against pitch, where the power law was fitted to several textures."""
    if not has_slopes(comparison):
        return Section("K against pitch", "slopes", ())
    return Section(
        "K against pitch",
        "slopes",
        (
            Picture(
                comparison,
                "slopes",
                "Left: K, the rate at which Q grows with s = √(p/E), of each texture. Right: the "
                "same times half the pitch: the c that each texture asks for. Modified says it is "
                "one number; Hybrid lets it grow as ridges get narrower. Bars and band: 90 % "
                "intervals; Hybrid is set a little to the right of the power law.",
            ),
        ),
    )


def smooth_section(comparison: Comparison) -> Section:
    """Return the smooth cylinder against Hertz (the study's Fig. 3)."""
    names = {
        "half-plane": "Half-plane equation, no grooves",
        "small-strain": "Finite elements, small strain",
        "neo-hooke": "Finite elements, neo-Hookean",
    }
    rows = [
        [
            names.get(curve.name, curve.name),
            str(len(curve.count)),
            decimals(curve.r_squared, 5),
            decimals(100 * curve.worst_count_error, 2),
            decimals(100 * curve.worst_load_error, 2),
        ]
        for curve in smooth_cylinder()
    ]
    a, b = FIG_3_TEXTURE
    return Section(
        "Smooth cylinder against Hertz",
        "smooth",
        (
            Picture(
                comparison,
                "smooth-cylinder",
                f"Contact length without grooves, in ridges of a/R = {a:g}, b/R = {b:g} by eq. "
                "(2), against Hertz, eq. (1). The half-plane equation is Hertz to rounding; a "
                "whole cylinder of finite elements comes out a little stiffer as contact widens.",
            ),
            table(
                ["Computed by", "Loads", "R² of Hertz on Q′", "Worst error in Q′, %", "in load, %"],
                rows,
            ),
        ),
    )
