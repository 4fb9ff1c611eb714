"""Reading and writing of fits as NetCDF files, which both release lines of arviz can open."""

import io
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ridgebayes._types import __version__
from ridgebayes.distributions.grammar import priors_from_json, priors_to_json
from ridgebayes.errors import InputError
from ridgebayes.inference.arviz_groups import Variables, attributes, labelled_groups
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.diagnostics import SUMMARY_COLUMNS
from ridgebayes.inference.posterior import SAMPLERS, Posterior
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.model import Model
from ridgebayes.model.noise import NUGGET, Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.atomic import replacing
from ridgebayes.runtime.reading import check_tree, read_bytes
from ridgebayes.runtime.text import clipped, one_line_message

_MIN_COMPRESSED_BYTES = 1_000  # compressing smaller arrays saves nothing
# Groups that only arviz uses, stored in single precision.
_SINGLE_PRECISION = ("log_likelihood", "log_prior", "prior_predictive", "posterior_predictive")
_GROUPS_READ = ("constant_data", "observed_data", "sample_stats")
Read = TypeVar("Read")


@dataclass(frozen=True, eq=False)
class Stored:
    """Content of a fit's file.

    Parameters
    ----------
    attrs : dict of str to object
        Attributes of the file.
    groups : dict of str to dict of str to ndarray
        Arrays by group and name.
    """

    attrs: dict[str, Any]
    groups: dict[str, dict[str, NDArray[Any]]]


def write_netcdf(fit: Posterior, path: str | os.PathLike[str], *, complete: bool = True) -> None:
    """Write a fit atomically; with `complete`, include the groups that only arviz uses."""
    origin = attributes(fit)
    attrs: dict[str, Any] = {
        **origin,
        "ridgebayes_version": __version__,
        "form": fit.form.name,
        "noise": fit.noise.name,
        "priors": priors_to_json(fit.model.given_priors),
        "summary": fit.summary.to_json(orient="records", double_precision=15),
        "missing": json.dumps(fit.convergence_failures),
        "stopping_rule_missing": json.dumps(fit.chains.convergence_failures),
        "seed": str(fit.seed),
        "sampler": fit.sampler,
        "cautions": json.dumps(fit.cautions),
        "n_walker": fit.chains.u.shape[2],
    }
    if fit.model.data.n_series > 1:
        attrs["series"] = json.dumps(fit.model.data.series_labels)
    if fit.noise.nugget != NUGGET:
        attrs["nugget"] = fit.noise.nugget
    groups = labelled_groups(fit, complete=complete)
    write_groups(groups, path, attrs, origin if complete else {})


def write_groups(
    groups: Mapping[str, Variables],
    path: str | os.PathLike[str],
    attrs: Mapping[str, Any],
    group_attrs: Mapping[str, str] | None = None,
) -> None:
    """Write compressed groups of draws atomically, with attributes of the file and the groups."""
    # h5netcdf is used directly, because xarray would load pint, and dask if it is installed.
    import h5netcdf

    content = io.BytesIO()
    # The headers of HDF5 1.10 take half the bytes of those of 1.0, the default.
    with h5netcdf.File(content, "w", libver="v110") as file:
        file.attrs.update(attrs)
        for name, variables in groups.items():
            group = file.create_group(name)
            group.attrs.update(group_attrs or {})
            _write_group(group, variables, np.float32 if name in _SINGLE_PRECISION else None)
    # The view is closed even if writing fails: Python 3.13 cannot close a buffer with open views.
    with replacing(Path(path)) as partial, content.getbuffer() as view:
        partial.write_bytes(view)


def _write_group(group: Any, variables: Variables, floats: type | None) -> None:
    import h5py

    for name, (dims, values) in variables.items():
        cells, options = np.asarray(values), {}
        if floats is not None and cells.dtype.kind == "f":
            cells = cells.astype(floats)
        if cells.dtype.kind in "OSU":
            options["dtype"] = h5py.string_dtype()
            cells = cells.astype(object)
        elif cells.nbytes > _MIN_COMPRESSED_BYTES:
            # gzip of level 1. Several chunks, as h5py chooses them, would take a tenth more bytes.
            options = {"compression": 1, "shuffle": True, "chunks": cells.shape}
        new = {
            dim: n for dim, n in zip(dims, cells.shape, strict=True) if dim not in group.dimensions
        }
        group.dimensions.update(new)
        group.create_variable(name, dims, data=cells, **options)


def read_netcdf(path: str | os.PathLike[str]) -> Posterior:
    """Read a fit that `write_netcdf` wrote.

    Raises
    ------
    InputError
        As `read_tree`.
    """
    return read_tree(path, _fit_of)


def read_tree(path: str | os.PathLike[str], fit_of: Callable[[Stored], Read]) -> Read:
    """Read the groups that a fit needs from a file of `write_groups`, and convert them by `fit_of`.

    Raises
    ------
    InputError
        If the file is missing, not NetCDF, damaged, or not written by this package; if it links to
        other files, or would take more memory than a posterior does.
    """
    # h5py is used directly, because xarray takes ten times as long and reads all groups.
    import h5py

    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; expected a posterior written by ridgebayes")
    content = read_bytes(Path(path))
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            check_tree(file, str(path))
            groups = {
                name: {key: _cells(variable) for key, variable in file[name].items()}
                for name in _GROUPS_READ
                if name in file
            }
            # A NetCDF file stores a number as an array of length one.
            attrs = {k: v.item() if np.shape(v) == (1,) else v for k, v in file.attrs.items()}
    except InputError:
        raise
    # h5py, and `fit_of` below, raise exceptions of many types for a damaged file.
    except Exception as error:
        raise InputError(
            f"{path}: not a readable NetCDF file ({one_line_message(error)})"
        ) from None
    if "ridgebayes_version" not in attrs:
        raise InputError(f"{path}: not a ridgebayes file; expected a posterior that it wrote")
    form = attrs.get("form")
    if isinstance(form, str) and form not in FORMS:
        raise InputError(
            f"{path}: holds form {clipped(form)}, which this package does not have; expected one "
            f"of {', '.join(FORMS)}: a fit of a form of your own cannot be read back"
        )
    try:
        return fit_of(Stored(attrs, groups))
    except Exception as error:
        raise InputError(
            f"{path}: damaged, not what ridgebayes writes ({one_line_message(error)}); run again"
        ) from None


def _cells(variable: Any) -> NDArray[Any]:
    """Return the values of a dataset, with text as str."""
    return np.asarray(variable.asstr()[()] if variable.dtype.kind in "OS" else variable[()])


def _fit_of(stored: Stored) -> Posterior:
    """Return the fit stored in a file; raises exceptions of any type if the content is invalid."""
    constant, observed = stored.groups["constant_data"], stored.groups["observed_data"]
    data = Observations(
        textures=tuple(
            zip(
                constant["a_over_R"].tolist(),
                constant["b_over_R"].tolist(),
                strict=True,
            )
        ),
        texture=constant["texture_index"].astype(np.int64),
        Q=constant["Q"].astype(np.int64),
        log_load=observed["log_load"],
        rel_se=constant["rel_se"],
        log_lower=constant["log_lower"],
        is_count=constant["is_count"].astype(bool),
        labels=tuple(str(label) for label in constant["texture"]),
    )
    if "series" in stored.attrs:
        series = constant["series_index"].astype(np.int64)
        labels = tuple(map(str, json.loads(stored.attrs["series"])))
        data = replace(data, series=series, series_labels=labels)
    noise = Noise.named(stored.attrs["noise"])
    model = Model(
        data,
        form_named(stored.attrs["form"]),
        replace(noise, nugget=float(stored.attrs.get("nugget", NUGGET))),
        priors_from_json(stored.attrs["priors"]),
    )
    chains = chains_of(stored)
    summary = pd.DataFrame(json.loads(stored.attrs["summary"]))
    convergence_failures = tuple(json.loads(stored.attrs["missing"]))
    cautions = tuple(json.loads(stored.attrs.get("cautions", "[]")))
    _check_shapes(data, chains)
    if list(summary) != SUMMARY_COLUMNS or tuple(summary["parameter"]) != model.parameter_names:
        raise ValueError("summary of other parameters")
    summary = summary.astype(dict.fromkeys(SUMMARY_COLUMNS[1:], float))
    texts = (*convergence_failures, *chains.convergence_failures, *cautions)
    if not all(isinstance(text, str) for text in texts):
        raise ValueError("missing or cautions is not text")
    sampler = stored.attrs.get("sampler", "emcee")
    if sampler not in SAMPLERS:
        raise ValueError(f"sampler {sampler!r}")
    seed = int(stored.attrs["seed"])
    return Posterior(model, chains, summary, convergence_failures, seed, sampler, cautions=cautions)


def chains_of(stored: Stored, n_coordinate: int = -1) -> Chains:
    """Return the chains stored in a file, of `n_coordinate` coordinates.

    Exceptions of any type are raised if the content is invalid.
    """
    stats, n_walker = stored.groups["sample_stats"], int(stored.attrs["n_walker"])
    u = stats["u"]
    shape = (u.shape[0], u.shape[1] // n_walker, n_walker)
    return Chains(
        u.reshape(*shape, n_coordinate),
        stats["lp"].reshape(shape),
        stats["acceptance_rate"],
        stats["tau"],
        tuple(json.loads(stored.attrs["stopping_rule_missing"])),
    )


def _check_shapes(data: Observations, chains: Chains) -> None:
    """Raise ValueError if rows differ in length, or if indices or numbers are invalid."""
    n, n_texture = len(data.Q), len(data.textures)
    rows = (data.texture, data.log_load, data.rel_se, data.log_lower, data.is_count, data.series)
    if not n or any(column.shape != (n,) for column in rows) or len(data.labels) != n_texture:
        raise ValueError("rows of different numbers")
    if data.texture.min() < 0 or data.texture.max() >= n_texture:
        raise ValueError("a row of no texture")
    if data.series.min() < 0 or data.series.max() >= data.n_series:
        raise ValueError("a row of no series")
    widths = np.array([data.a_over_R, data.b_over_R])
    finite = (widths, data.log_load, data.rel_se, chains.u, chains.log_density, chains.acceptance)
    if not chains.u.size or not all(np.isfinite(column).all() for column in finite):
        raise ValueError("numbers that are not finite")
    if not (widths > 0).all():
        raise ValueError("a width that is not above 0")
