"""Every code block of the README and of the pages in docs/ is run, or says why it is not.

A page is one test of its Python blocks, in their order, and one of its commands. Before a block
that cannot be run here stands `<!-- not run: WHY -->`; options of its commands are still checked.
"""

import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import ridgebayes as rb
from ridgebayes.commands.cli import app
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import resolve_priors
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.runtime.reading import read_toml

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PARTS = {"_generated", "examples", "names", "mutation"}  # folders made from elsewhere, or parts
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
PAGES += [
    path for path in sorted(DOCS.rglob("*.md")) if PARTS.isdisjoint(path.parts[len(DOCS.parts) :])
]
BLOCK = re.compile(
    r"^(<!-- not run: [^\n]+ -->\n)?```(\w*)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL
)
DIRECTIVE = re.compile(r"^(```+)\{.*?^\1$", flags=re.MULTILINE | re.DOTALL)
KNOWN = {"", "python", "sh", "toml", "text", "bibtex"}


def blocks_of(path, language, *, run=True):
    """Return the blocks of one language on a page; without those that cannot be run."""
    found = BLOCK.findall(DIRECTIVE.sub("", path.read_text(encoding="utf-8")))
    return [code for not_run, name, code in found if name == language and not (run and not_run)]


def pages_with(language, **which):
    pages = [path for path in PAGES if blocks_of(path, language, **which)]
    return pytest.mark.parametrize("path", pages, ids=[path.stem for path in pages])


def commands(path, **which):
    """Return the command lines of a page, without their comments, as words."""
    lines = "\n".join(blocks_of(path, "sh", **which)).replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    return tmp_path


def test_blocks__are_in_languages_that_are_checked_here():
    for path in PAGES:
        text = DIRECTIVE.sub("", path.read_text(encoding="utf-8"))
        assert {name for _, name, _ in BLOCK.findall(text)} <= KNOWN, path
        fences = len(re.findall(r"^```", text, flags=re.MULTILINE))
        assert fences == 2 * len(BLOCK.findall(text)), path


@pytest.mark.usefixtures("made_once")
@pages_with("python")
def test_python_blocks__print_what_their_comments_say(path, folder, monkeypatch):
    # Figures take most of a report, and have their own tests.
    monkeypatch.setattr(Gallery, "file", lambda self, name, kind: b"")
    said, expected, namespace = [], [], {}
    namespace["print"] = lambda *words: said.append(" ".join(map(str, words)))
    for code in blocks_of(path, "python"):
        expected += re.findall(r"^ *print\(.*\)\s+# (.+)$", code, flags=re.MULTILINE)
        exec(compile(code, str(path), "exec"), namespace)  # the block is ours
    assert said == expected


@pages_with("sh", run=False)
def test_command_lines__are_known(path):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    program = typer.main.get_command(app)
    for words in commands(path, run=False):
        if words[0] == "ridgebayes" and words[1] in program.commands:
            program.commands[words[1]].make_context(words[1], words[2:], resilient_parsing=False)
        elif words[0] == "make":
            assert re.search(rf"^{words[1]}:", makefile, flags=re.MULTILINE), words
        elif "-m" in words:
            assert importlib.util.find_spec(words[words.index("-m") + 1]), words
        else:
            assert " ".join(words[:2]) in {
                "pip install",
                "ridgebayes --version",
                "pre-commit install",
            }


# The page of all commands takes long; each of them has tests of its own in tests/commands.
LONG = DOCS / "commands.md"
RUN = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.long] if path == LONG else [])
    for path in PAGES
    if any(words[0] == "ridgebayes" for words in commands(path))
]


@pytest.mark.parametrize("path", RUN)
def test_commands__run(path, folder):
    for words in commands(path):
        if words[0] == "ridgebayes":
            done = CliRunner().invoke(app, words[1:], catch_exceptions=False)
            assert done.exit_code == 0, done.output


@pages_with("toml")
def test_toml_blocks__can_be_read(path):
    for code in blocks_of(path, "toml"):
        assert tomllib.loads(code)


def test_priors_page__shows_the_default_priors(tmp_path):
    (block,) = blocks_of(ROOT / "docs" / "priors.md", "toml")
    (tmp_path / "priors.toml").write_text(block, encoding="utf-8")
    data = Observations.from_table(rb.paper_sweep())
    text = read_toml(tmp_path / "priors.toml")
    found = resolve_priors(text, [rb.Hybrid()], [Noise()], data)
    assert list(found) == ["hybrid", "noise"]
    assert found["hybrid"] | found["noise"] == default_priors(rb.Hybrid())


def test_start_page__shows_a_table_that_can_be_read(tmp_path):
    (block,) = blocks_of(ROOT / "docs" / "start.md", "text")
    (tmp_path / "mine.csv").write_text(block, encoding="utf-8")
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
    assert len(told) == 13
    assert [message for message in told if message not in code] == []


def test_citing_page__has_the_names_of_the_citation_file():
    (block,) = blocks_of(DOCS / "citing.md", "bibtex")
    fields = dict(
        re.findall(r"^  (\w+) = \{+(.+?)\}+,$", block.partition("@article")[0], flags=re.M)
    )
    article = dict(
        re.findall(r"^  (\w+) = \{+(.+?)\}+,$", block.partition("@article")[2], flags=re.M)
    )
    known = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert fields["version"] == rb.__version__
    assert set(fields) == {"title", "author", "version"}
    assert set(article) == {"title", "journal", "doi"}
    for value in (*fields.values(), *article.values()):
        assert value in known


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
