"""What importing costs, what the package offers by name, and which module may import what."""

import ast
import importlib.metadata
import json
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import ridgebayes as rb

HEAVY = ("numpy", "pandas", "scipy", "matplotlib", "xarray", "emcee", "arviz", "corner")
PACKAGE = Path(rb.__file__).parent
COMMANDS = (
    "run",
    "generate",
    "fit",
    "compare",
    "predict",
    "coverage",
    "plan",
    "cost",
    "import",
    "export-deck",
    "report",
)


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout


def loaded_after(code: str) -> list[str]:
    """Return which heavy libraries a fresh interpreter has loaded after some lines."""
    ask = f"import json, sys; print(); print(json.dumps([n for n in {HEAVY} if n in sys.modules]))"
    return json.loads(python(f"{code}\n{ask}").splitlines()[-1])


def test_import__loads_no_heavy_library():
    assert loaded_after("import ridgebayes") == []


def test_import__the_check_above_would_see_one():
    assert "numpy" in loaded_after("import ridgebayes; ridgebayes.Hybrid")


def test_import__loads_no_other_module_of_the_package():
    code = "import sys, ridgebayes; print([m for m in sys.modules if m.startswith('ridgebayes.')])"
    assert python(code).strip() == "[]"


def test_help__loads_no_heavy_library():
    code = (
        "import sys\n"
        "from ridgebayes.commands.cli import main\n"
        f"for words in {[[], *([name] for name in COMMANDS)]}:\n"
        "    sys.argv = ['ridgebayes', *words, '--help']\n"
        "    try: main()\n"
        "    except SystemExit as stopped: assert not stopped.code\n"
        f"    print('after', *words, [name for name in {HEAVY} if name in sys.modules])"
    )
    told = [line for line in python(code).splitlines() if line.startswith("after ")]
    assert told == [" ".join(["after", *words, "[]"]) for words in ([], *zip(COMMANDS))]


def test_records_and_errors__need_no_sampler():
    assert "emcee" not in loaded_after("import ridgebayes; ridgebayes.paper_sweep()")


def test_generate__loads_no_module_that_samples_or_reports():
    code = (
        "import sys, ridgebayes as rb; rb.generate(rb.Scene.paper())\n"
        "print(*(m for m in sys.modules if m.startswith('ridgebayes')))"
    )
    loaded = python(code).split()
    rooms = {name.split(".")[1] for name in loaded if "." in name}
    assert not rooms & {"inference", "predict", "evidence", "checks", "report"}
    assert len(loaded) <= 40


def test_forms_and_tables__need_no_plots():
    code = "import ridgebayes; ridgebayes.compare, ridgebayes.Fit, ridgebayes.generate"
    assert not {"matplotlib", "corner", "arviz"} & set(loaded_after(code))


@pytest.mark.parametrize("name", sorted(set(rb._HOME) - {"__version__"}))
def test_every_offered_name_resolves(name):
    value = rb.__getattr__(name)
    assert value is getattr(import_module(rb._HOME[name]), name)
    assert value.__name__ == name
    assert value.__doc__
    assert name in dir(rb)


def test_offered_names__are_the_homes_and_the_version():
    assert rb.__all__ == list(rb._HOME)


def test_unknown_name__is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"'ridgebayes' has no attribute 'Hybird'"):
        rb.Hybird  # noqa: B018


def test_version__is_that_of_the_installed_package():
    assert rb.__version__ == importlib.metadata.version("ridgebayes")


def test_types__are_offered_to_users():
    assert (PACKAGE / "py.typed").is_file()


def test_errors__can_be_told_apart_and_caught_together():
    assert issubclass(rb.InputError, rb.RidgebayesError)
    assert issubclass(rb.InputError, ValueError)
    assert issubclass(rb.ComputationError, rb.RidgebayesError)
    assert issubclass(rb.ComputationError, RuntimeError)
    assert not issubclass(rb.InputError, rb.ComputationError)


@pytest.mark.parametrize(
    ("library", "homes"),
    [
        ("emcee", ["inference/emcee_sampling"]),
        ("arviz", ["runtime/quiet"]),
        (
            "typer",
            [f"commands/{name}" for name in ("cli", "shared_options", "table_options")],
        ),
        ("rich", ["commands/terminal", "runtime/progress"]),
        ("distributed", ["runtime/cluster"]),
    ],
)
def test_each_heavy_library_has_one_home(imports, library, homes):
    importers = {name for name, roots in imports.items() if library in roots}
    assert importers == {f"{home}.py" for home in homes}


@pytest.fixture(scope="module")
def imports():
    """The libraries that each module of the package imports anywhere."""
    return {
        path.relative_to(PACKAGE).as_posix(): {
            root
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            for root in _roots(node)
        }
        for path in PACKAGE.rglob("*.py")
    }


def _roots(node: ast.AST) -> set[str]:
    if isinstance(node, ast.Import):
        return {alias.name.split(".")[0] for alias in node.names}
    if isinstance(node, ast.ImportFrom) and node.level == 0:
        return {(node.module or "").split(".")[0]}
    return set()


def test_mechanics__never_sees_a_scene_a_table_or_a_fit():
    for path in (PACKAGE / "contact").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ridgebayes."):
                allowed = {"_types", "errors", "contact"}
                if path.name == "fields.py":  # writes files, whole or not at all
                    allowed.add("runtime")
                assert node.module.split(".")[1] in allowed, path.name


def test_no_public_function_has_the_name_of_a_module():
    # Importing a module sets it as an attribute of the package: it would replace the function.
    modules = {path.stem for path in PACKAGE.iterdir() if not path.name.startswith("_")}
    assert not modules & set(rb.__all__)


def test_modules__have_400_lines_at_most():
    lines = {path: path.read_text(encoding="utf-8").count("\n") for path in PACKAGE.rglob("*.py")}
    assert {path.name: n for path, n in lines.items() if n > 400} == {}


@pytest.mark.parametrize("path", sorted((PACKAGE.parents[1] / "data").glob("*.py")))
def test_recipes_of_data__import_what_exists(path):
    runpy.run_path(str(path))  # computes nothing: the name of the module is not __main__


SCENE = rb.Scene.of([(0.02, 0.02)])


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: rb.plan(5), "scene"),
        (lambda: rb.export_deck(5, "calculix", "x.inp"), "scene"),
        (lambda: rb.export_deck(SCENE, "calculix", 5), "path"),
        (lambda: rb.generate(SCENE, rel_tol="x"), "rel_tol"),
        (lambda: rb.generate(SCENE, executor=5), "executor"),
        (lambda: rb.contact_at_loads(SCENE, []), "p_over_E"),
        (lambda: rb.design(5, SCENE, "P(Q >= 8) >= 0.95"), "source"),
        (lambda: rb.friction_inputs(None, SCENE), "source"),
        (lambda: rb.coverage(rb.paper_sweep(), 5), "forms"),
        (lambda: rb.cost(rb.paper_sweep(), repeats=0), "repeats"),
        (lambda: rb.import_table(), "paths"),
        (lambda: rb.read_run(None), "folder"),
        (lambda: rb.run(rb.paper_sweep(), settings=5), "settings"),
        (lambda: rb.Scene.from_dict([1]), "data"),
        (lambda: rb.SampleSettings(n_burn="x"), "n_burn"),
        (lambda: rb.Normal("x", 1.0), "mean"),
        (lambda: rb.Empirical.of(["x"]), "a sample"),
    ],
)
def test_public_functions__name_an_argument_of_a_wrong_type(call, name):
    with pytest.raises(rb.InputError, match=f"^{name}[:,; ].*expected "):
        call()
