"""Environments of the peers: one each, made when it is first asked for."""

import os
import subprocess
import sys
import venv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

# Versions as measured; ranges where what is newest depends on the interpreter's version.
REQUIREMENTS: Mapping[str, tuple[str, ...]] = {
    "emcee": ("emcee==3.1.6", "scipy"),
    "zeus": ("zeus-mcmc==2.5.4", "scipy"),
    "pymc": ("pymc>=5.28,<7", "scipy"),
    "nutpie": ("nutpie>=0.16.8,<0.17", "pymc>=5.28,<7", "scipy"),
    "dynesty": ("dynesty==3.1.0", "scipy"),
    "ultranest": ("ultranest==4.6.3", "scipy"),
    "nautilus": ("nautilus-sampler==1.0.6", "scipy"),
    "bilby": ("bilby==2.8.2", "dynesty==3.1.0", "scipy"),
}
OWN = "own"  # the environment that the driver runs in, which has ridgebayes


class NoEnvironmentError(Exception):
    """An environment that could not be made, with the reason."""


@dataclass
class Environments:
    """Makes environments in a folder, and remembers which it could not make.

    Parameters
    ----------
    folder : Path
        Each gets a folder of its own in it; one that is there already is used again.
    """

    folder: Path
    _failed: dict[str, str] = field(default_factory=dict)

    def python(self, name: str) -> Path:
        """Return the interpreter of an environment, making it first where needed.

        Raises
        ------
        NoEnvironmentError
            If a requirement cannot be installed.
        """
        if name == OWN:
            return Path(sys.executable)
        if name in self._failed:
            raise NoEnvironmentError(self._failed[name])
        home = self.folder / name
        python, done = home / "bin" / "python", home / "installed.txt"
        wanted = "\n".join(REQUIREMENTS[name])
        if not (done.exists() and done.read_text() == wanted):
            try:
                self._make(home, python, REQUIREMENTS[name])
            except NoEnvironmentError as reason:
                self._failed[name] = str(reason)
                raise
            done.write_text(wanted)
        return python

    def _make(self, home: Path, python: Path, requirements: tuple[str, ...]) -> None:
        print(f"making {home}: {' '.join(requirements)}", flush=True)
        try:
            venv.create(home, with_pip=True, clear=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise NoEnvironmentError(f"no environment: {error}") from None
        command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        ended = subprocess.run([*command, *requirements], capture_output=True, text=True)
        if ended.returncode:
            said = [line for line in ended.stderr.splitlines() if line.startswith("ERROR")]
            # The last is what it comes to; those before list what was looked at.
            raise NoEnvironmentError(f"not installed: {said[-1] if said else 'pip gave no reason'}")


def one_thread() -> dict[str, str]:
    """Return the process environment with every pool of threads held to one."""
    pools = ("OMP", "OPENBLAS", "MKL", "NUMBA", "RAYON", "VECLIB_MAXIMUM")
    return {**os.environ, **{f"{pool}_NUM_THREADS": "1" for pool in pools}}
