"""The contact forms: how many ridges at a load, and the load each pair of ridges needs.

Write s = sqrt(p/E) at nu = 0.5, L = a/R + b/R and h = Q/2 - 1 for the pairs beyond the first.
Every form is a known function of texture and count, divided by a rate with the coefficients:

    s(Q) = shape(Q, a, b) / rate(a, b; theta).

| form       | shape              | rate              | coefficients      |
|------------|--------------------|-------------------|-------------------|
| Classic    | h L + B/2          | c                 | c                 |
| PowerLaw   | Q - 2              | K of the texture  | one K per texture |
| Modified   | h L                | c                 | c                 |
| Hybrid     | h                  | c1/L + c2/A       | c1, c2            |
| HalfPlane  | L sqrt(F_k/0.75)   | c                 | c (theory: 1)     |

That one shape is what makes the likelihood cheap: in log load the coefficients shift all rows of a
texture alike, so a texture enters as a count, a mean and a sum of squares.

Poisson's ratio enters through the reduced load (p/E)(1 - nu^2)/0.75, as half-plane theory says.
Loads are computed with +, *, / and sqrt alone, which IEEE rounds the same in arrays of any size:
`count` at a load that `load` returned is exactly that Q.
"""

from ridgebayes.errors import InputError
from ridgebayes.model.forms.base import Form
from ridgebayes.model.forms.closed import Classic, Hybrid, Modified
from ridgebayes.model.forms.half_plane import HalfPlane
from ridgebayes.model.forms.power_law import PowerLaw

__all__ = [
    "FORMS",
    "Classic",
    "Form",
    "HalfPlane",
    "Hybrid",
    "Modified",
    "PowerLaw",
    "as_form",
    "form_named",
]

FORMS: dict[str, type[Form]] = {
    form.name: form for form in (Classic, PowerLaw, Modified, Hybrid, HalfPlane)
}


def form_named(name: str) -> Form:
    """Return the form of that name, such as ``"hybrid"``.

    Raises
    ------
    InputError
        If there is none; the message lists those there are.

    Examples
    --------
    >>> form_named("hybrid").parameter_names
    ('c1', 'c2')
    """
    if name not in FORMS:
        raise InputError(f"form {name!r}: unknown; expected one of {', '.join(FORMS)}")
    return FORMS[name]()


def as_form(form: Form | str) -> Form:
    """Return a form, by its name where that is given.

    Raises
    ------
    InputError
        If it is neither, or no form has that name.
    """
    if isinstance(form, Form):
        return form
    if isinstance(form, str):
        return form_named(form)
    raise InputError(f"form: expected a form, such as Hybrid(), or its name, got {form!r}")
