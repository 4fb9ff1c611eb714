"""Every code block of the README and of the pages in docs/ is run.

The blocks of a page are one test: in their order, in one folder, Python in one namespace. A comment
before a block says more of it:

`<!-- file: NAME -->`: the block is a file that the blocks after it read.
`<!-- long -->`: it takes a minute, and is left to `make test-long`, with all others of its page.
`<!-- long: MODULE -->`: it needs a module of the extra `samplers` too.

Pages of `LONG_PAGES` repeat commands that other tests run; all are left to `make test-long`.

A command that has to fail says `exit code 2` in its comment. What no test can run, such as the
tests themselves, stands in a table of commands, and not in a block.
"""

import contextlib
import importlib.util
import os
import re
import runpy
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
import tomllib
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.commands.cli import app
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import resolve_priors
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.runtime.reading import read_toml
from ridgebayes.scene.toml import SECTIONS
from ridgebayes.table.datafiles import data_path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PARTS = {"_generated", "examples", "names"}  # folders made from elsewhere
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES += [
    path for path in sorted(DOCS.rglob("*.md")) if PARTS.isdisjoint(path.parts[len(DOCS.parts) :])
]
BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>\w+)(?:: (?P<what>\S+))? -->\n)?```(?P<language>\w*)\n(?P<code>.*?)^```$",
    flags=re.MULTILINE | re.DOTALL,
)
DIRECTIVE = re.compile(r"^(```+)\{.*?^\1$", flags=re.MULTILINE | re.DOTALL)
RUN = {"python", "sh", "console"}
LONG_PAGES = {"commands", "design", "index", "start"}
FILES = {"text", "toml"}
INSTALL = "pip install ."  # run in an environment of its own
PORT = "8786"  # of Dask on the pages; here a free one


@dataclass(frozen=True)
class Block:
    language: str
    code: str
    mark: str | None
    what: str | None


def blocks_of(path, language=None):
    """Return the blocks of a page in their order, or those of one language."""
    text = DIRECTIVE.sub("", path.read_text(encoding="utf-8"))
    found = [Block(**one.groupdict()) for one in BLOCK.finditer(text)]
    return [block for block in found if language in (None, block.language)]


def pages_with(language):
    pages = [path for path in PAGES if blocks_of(path, language)]
    return pytest.mark.parametrize("path", pages, ids=[path.stem for path in pages])


def command_lines(code):
    """Return each command of a block as words, and its comment."""
    lines = code.replace("\\\n", " ").splitlines()
    return [(words, line) for line in lines if (words := shlex.split(line, comments=True))]


def test_blocks__are_in_languages_that_are_run_or_read_here():
    for path in PAGES:
        text = DIRECTIVE.sub("", path.read_text(encoding="utf-8"))
        fences = len(re.findall(r"^```", text, flags=re.MULTILINE))
        assert fences == 2 * len(blocks_of(path)), path
        for block in blocks_of(path):
            assert block.language in RUN | FILES | {"bibtex"}, path
            assert block.mark in {None, *(("long",) if block.language in RUN else ("file",))}, path


def test_comments__are_of_blocks():
    for path in PAGES:
        comments = re.findall(r"^<!-- \w+", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert len(comments) == sum(block.mark is not None for block in blocks_of(path)), path


class Page:
    """A folder where the blocks of a page are run one after another."""

    def __init__(self, path, folder, monkeypatch, stack):
        self.path, self.folder = path, folder
        self._monkeypatch, self._stack = monkeypatch, stack
        self._port = free_port()
        self._said, self._expected = [], []
        self._namespace = {"__name__": "__main__", "print": self._print}

    def _print(self, *words):
        self._said.append(" ".join(map(str, words)))

    def run(self, block):
        if block.mark == "file":
            (self.folder / block.what).write_text(block.code, encoding="utf-8")
        elif block.language in RUN:
            getattr(self, f"_{block.language}")(block.code)

    def _python(self, code):
        self._expected += re.findall(r"^ *print\(.*\)\s+# (.+)$", code, flags=re.MULTILINE)
        with self._monkeypatch.context() as patch:
            # Figures take most of a report, and have their own tests.
            patch.setattr(Gallery, "file", lambda self, name, kind: b"")
            exec(compile(code, str(self.path), "exec"), self._namespace)  # the block is ours
        assert self._said == self._expected

    def _sh(self, code):
        for words, line in command_lines(code.replace(PORT, self._port)):
            if words[-1] == "&":
                self._stack.enter_context(in_background(words[:-1]))
                wait_for(int(self._port))
            elif words[0] == "ridgebayes":
                done = CliRunner().invoke(app, words[1:], catch_exceptions=False)
                (code,) = re.findall(r"# .*exit code (\d)", line) or ["0"]
                assert done.exit_code == int(code), done.output
            else:
                assert " ".join(words) == INSTALL, words

    def _console(self, code):
        command, said = code.removeprefix("$ ridgebayes ").split("\n", 1)
        assert CliRunner().invoke(app, shlex.split(command)).output == said


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return str(found.getsockname()[1])


def wait_for(port):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
            return
        time.sleep(0.05)
    raise TimeoutError


@contextlib.contextmanager
def in_background(words):
    program = Path(sys.executable).parent / words[0]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    started = subprocess.Popen([program, *words[1:]], **quiet, start_new_session=True)
    try:
        yield
    finally:
        os.killpg(started.pid, signal.SIGKILL)  # what it started too
        started.wait()


@pytest.fixture
def page_of(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    with ExitStack() as stack:
        yield lambda path: Page(path, tmp_path, monkeypatch, stack)


def runnable(path, *, long):
    """Return the blocks of a page that one test runs, with the files that they read."""
    found = [block for block in blocks_of(path) if long or block.mark != "long"]
    return found if any(block.language in RUN for block in found) else []


def pages_to_run(*, long):
    pages = [path for path in PAGES if runnable(path, long=long)]
    if long:
        pages = [path for path in pages if runnable(path, long=True) != runnable(path, long=False)]
    marks = {True: pytest.mark.long, False: ()}
    pages = [pytest.param(path, marks=marks[path.stem in LONG_PAGES]) for path in pages]
    return pytest.mark.parametrize("path", pages, ids=lambda path: path.stem)


@pytest.mark.usefixtures("made_once")
@pages_to_run(long=False)
def test_blocks__run_and_print_what_their_comments_say(path, page_of):
    page = page_of(path)
    for block in runnable(path, long=False):
        page.run(block)


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # of other samplers
@pytest.mark.usefixtures("made_once")
@pages_to_run(long=True)
def test_long_blocks__run_after_the_others_of_their_page(path, page_of):
    page = page_of(path)
    for block in runnable(path, long=True):
        if block.mark == "long" and block.what:
            pytest.importorskip(block.what, reason="of the extra samplers")
        page.run(block)


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # of other samplers
@pytest.mark.usefixtures("made_once")
@pytest.mark.parametrize("sampler", ["numpyro", "stan"])
def test_reuse_scripts__run_after_their_page(sampler, page_of):
    pytest.importorskip(sampler, reason="of the extra samplers")
    page = page_of(DOCS / "reuse.md")
    for block in runnable(page.path, long=False):
        page.run(block)
    runpy.run_path(str(DOCS / "reuse" / f"with_{sampler}.py"))


@pytest.mark.long
def test_installation__works_as_the_pages_say(tmp_path):
    uv = shutil.which("uv", path=Path(sys.executable).parent) or "uv"
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([uv, "venv", "-q", "--python", sys.executable, tmp_path / "env"], check=True)
    words = INSTALL.split()
    subprocess.run([uv, *words, "-q", "--python", python], cwd=ROOT, check=True)
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    told = subprocess.run(
        [python.with_name("ridgebayes"), "--version"], env=clean, capture_output=True, text=True
    )
    assert told.stdout.split()[-1] == rb.__version__


def commands_in_tables(path):
    """Return the commands that a page tells of in a table."""
    text = path.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `((?:make|pip|pre-commit|nice|\S*python) .+?)` \|", text, flags=re.M)
    return [shlex.split(line) for line in rows]


def test_commands_in_tables__are_known():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    found = [words for path in PAGES for words in commands_in_tables(path)]
    assert len(found) == 12
    for words in found:
        if words[0] == "make":
            assert re.search(rf"^{words[1]}:", makefile, flags=re.MULTILINE), words
        elif "-m" in words:
            assert importlib.util.find_spec(words[words.index("-m") + 1]), words
        else:
            assert " ".join(words[:2]) in {"pip install", "pre-commit install"}


@pages_with("toml")
def test_toml_blocks__can_be_read(path):
    for block in blocks_of(path, "toml"):
        assert tomllib.loads(block.code)


def test_priors_page__shows_the_default_priors(tmp_path):
    (block,) = blocks_of(ROOT / "docs" / "priors.md", "toml")
    (tmp_path / "priors.toml").write_text(block.code, encoding="utf-8")
    data = Observations.from_table(rb.paper_sweep())
    text = read_toml(tmp_path / "priors.toml")
    found = resolve_priors(text, [rb.Hybrid()], [Noise()], data)
    assert list(found) == ["hybrid", "noise"]
    assert found["hybrid"] | found["noise"] == default_priors(rb.Hybrid())


def test_start_page__shows_a_table_that_can_be_read(tmp_path):
    *_, block = blocks_of(ROOT / "docs" / "start.md", "text")
    (tmp_path / "mine.csv").write_text(block.code, encoding="utf-8")
    assert len(rb.read_table(tmp_path / "mine.csv").calibration) == 3


def test_command_table__lists_every_command_and_no_other():
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `ridgebayes (\S+)` \|", text, flags=re.MULTILINE)
    assert listed == [one.name or one.callback.__name__ for one in app.registered_commands]


def test_messages_page__has_messages_of_the_code():
    code = "".join(
        re.sub(r'"\s*f?"', "", path.read_text(encoding="utf-8"))  # a text on several lines is one
        for path in sorted((ROOT / "src").rglob("*.py"))
    )
    text = (DOCS / "messages.md").read_text(encoding="utf-8")
    told = re.findall(r"^\| `(.+?)` \|", text, flags=re.MULTILINE)
    assert len(told) == 18
    assert [message for message in told if message not in code] == []


def test_citing_page__has_the_names_of_the_citation_file():
    (block,) = blocks_of(DOCS / "citing.md", "bibtex")
    fields = dict(
        re.findall(r"^  (\w+) = \{+(.+?)\}+,$", block.code.partition("@article")[0], flags=re.M)
    )
    article = dict(
        re.findall(r"^  (\w+) = \{+(.+?)\}+,$", block.code.partition("@article")[2], flags=re.M)
    )
    known = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert fields["version"] == rb.__version__
    assert set(fields) == {"title", "author", "version"}
    assert set(article) == {"title", "journal", "doi"}
    for value in (*fields.values(), *article.values()):
        assert value in known


def test_scene_template__names_the_keys_that_a_scene_file_may_have():
    text = data_path("scenes/template.toml").read_text(encoding="utf-8")
    named, section = {}, ""
    for line in text.splitlines():
        if found := re.match(r"\[(\w+)\]", line):
            section = found[1]
        elif section and (found := re.match(r"(?:# )?(\w+) = ", line)):
            named.setdefault(section, []).append(found[1])
    keys = {name: sorted(model.model_fields) for name, model in SECTIONS.items()}
    del keys["joint"]  # for those who look for it
    assert {name: sorted(found) for name, found in named.items()} == keys


@pytest.mark.slow
def test_run_folder_page__names_the_columns_of_bands_and_loads(comparison):
    text = (DOCS / "run-folder.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.+`.*) \| (both|bands|loads) \|", text, flags=re.MULTILINE)
    named = {"bands": set(), "loads": set()}
    for cells, place in rows:
        for name in named if place == "both" else [place]:
            named[name] |= set(re.findall(r"`(\w+)`", cells))
    counts = {"p_q_ge_4", "p_q_ge_6"}  # and so on
    bands = bands_table(comparison, textures=[(0.022, 0.02)], loads=np.array([0.004, 0.009]))
    assert {one for one in bands if not one.startswith("p_q_ge_")} | counts == named["bands"]
    assert set(loads_table(comparison)) == named["loads"]


def test_option_names__exist():
    options = {
        option
        for command in typer.main.get_command(app).commands.values()
        for parameter in command.params
        for option in parameter.opts
    }
    options |= {"--help", "--version", "--install-completion"}
    for page in (
        "commands",
        "priors",
        "scenes",
        "limits",
        "choices",
        "import",
        "scaling",
        "messages",
    ):
        text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        assert set(re.findall(r"`(?:ridgebayes \w+ )?(--[\w-]+)", text)) <= options, page


def test_links__lead_to_files():
    for path in PAGES:
        text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
        for link in re.findall(r"\]\(([^)#:]+)(?:#[\w-]+)?\)", text):
            assert (path.parent / link).exists(), (path, link)
