"""Check the docstrings of all public names: ``python docs/check_docstrings.py``.

By the rules of numpydoc. Public are the names in `ridgebayes.__all__` and, of classes, the methods
and properties that do not begin with an underscore. Each name itself has an example too, which the
tests run, and each method and property is used in one: in its own, or in that of its class or of a
class that this derives from. Exits 1 and lists what is missing.
"""

import doctest
import inspect
import re
import sys
from collections.abc import Iterator

from numpydoc.validate import validate

import ridgebayes as rb
from ridgebayes.comparison.verdict import Verdict
from ridgebayes.scene.effects import Plan

# numpydoc's rules about content; ruff checks the layout.
PRIVATE_FIELDS = {"_frame", "_is_valid"}
RETURNED = (Verdict, Plan)  # records that users get and never make
INTERNAL: set[str] = set()
CHECKED = {
    "GL08": "no docstring",
    "PR01": "parameters not documented",
    "PR02": "unknown parameters",
    "PR03": "parameters in another order",
    "PR04": "a parameter without a type",
    "PR07": "a parameter without a description",
    "RT01": "no Returns section",
    "RT03": "a return value without a description",
    "YD01": "no Yields section",
}


def documented(owner: type, member: str) -> str:
    """Return where the words of a method stand: in the first class that has any.

    A method that fulfils a documented protocol inherits its words.
    """
    for base in owner.__mro__:
        what = vars(base).get(member)
        if what is not None and getattr(what, "__func__", what).__doc__:
            return f"{base.__module__}.{base.__qualname__}.{member}"
    return f"{owner.__module__}.{owner.__qualname__}.{member}"


def public_names() -> Iterator[tuple[str, bool]]:
    """Yield each public name, and whether it is called with arguments."""
    for name in rb.__all__:
        value = getattr(rb, name)
        if inspect.isclass(value):
            yield f"{value.__module__}.{value.__qualname__}", False
            for member, what in inspect.getmembers(value):
                inherited = not str(getattr(what, "__module__", "")).startswith("ridgebayes")
                # From Python 3.13 on a cached property counts as a routine, too.
                if member.startswith("_") or not (inspect.isroutine(what) and callable(what)):
                    continue
                if not inherited:
                    takes = len(inspect.signature(what).parameters) > isinstance(
                        inspect.getattr_static(value, member), type(public_names)
                    )
                    yield documented(value, member), takes
        elif inspect.isroutine(value):
            yield f"{value.__module__}.{value.__qualname__}", True


def problems(name: str, *, takes_arguments: bool) -> list[str]:
    """Return what numpydoc finds wrong with one docstring, a line each."""
    found = []
    for code, text in validate(name)["errors"]:
        # A function without arguments that says in one line what it returns needs no section
        # for it. Callers do not pass fields that begin with an underscore.
        if code == "PR01" and set(re.findall(r"'(\w+)'", text)) <= PRIVATE_FIELDS:
            continue
        if code in CHECKED and (takes_arguments or code == "GL08" or code.startswith("PR")):
            found.append(f"{name}: {code} {text}")
        if code == "EX01" and name.rpartition(".")[2] in rb.__all__:
            found.append(f"{name}: {code} {text}")
    return found


def examples(what: object) -> str:
    """Return the code of the examples in a docstring."""
    text = inspect.getdoc(what) or ""
    return "".join(example.source for example in doctest.DocTestParser().get_examples(text))


def function_of(what: object) -> object:
    """Return the function of a property, a cached one or a class method, which has the words."""
    return next(
        (getattr(what, at) for at in ("fget", "func", "__func__") if hasattr(what, at)), what
    )


def unused() -> Iterator[str]:
    """Yield the public methods and properties that no example uses."""
    for owner in (*(getattr(rb, name) for name in rb.__all__), *RETURNED):
        if not inspect.isclass(owner):
            continue
        ours = [base for base in owner.__mro__ if base.__module__.startswith("ridgebayes")]
        of_classes = "".join(map(examples, ours))
        for name in dict.fromkeys(name for base in ours for name in vars(base)):
            found = [function_of(vars(base)[name]) for base in ours if name in vars(base)]
            private = name.startswith("_") or f"{owner.__name__}.{name}" in INTERNAL
            if private or not inspect.isfunction(found[0]):
                continue
            if not re.search(rf"\.{name}\b", of_classes) and not any(map(examples, found)):
                yield f"{owner.__name__}.{name}: in no example, neither its own nor its class's"


def main() -> None:
    """Check all and say what is missing."""
    found = sorted(
        {line for name, takes in public_names() for line in problems(name, takes_arguments=takes)}
    )
    found += unused()
    print("\n".join(found) or f"docstrings of {len(set(public_names()))} public names are complete")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
